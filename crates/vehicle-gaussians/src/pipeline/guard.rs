//! Which measured depths lie on no surface of the vehicle: depth that was given or that a network predicted.
//!
//! Sensors, networks and resampling mix two surfaces in one pixel at a depth edge, or a surface and nothing, and a few
//! such pixels make a vehicle many times its size. The priors that estimate a surface have none of them.

use crate::prior::volume::Silhouette;
use rayon::prelude::*;
use vg_scene::mask::Label;
use vg_scene::{DepthMap, View};

/// A surface that is seen under 87 degrees changes its depth by this many pixel footprints from pixel to pixel; more is
/// an edge.
const STEEP_FOOTPRINTS: f32 = 20.0;

/// Sensors are noisy by less than this share of the depth from pixel to pixel.
const NOISE: f32 = 0.02;

/// Parts of one vehicle hang together to this, metres.
const LOOSE_M: f32 = 0.5;

/// A patch of depth that hangs together with nothing else, nearer or farther than all that does, is a stray below this
/// share of the vehicle's pixels.
const STRAY_SHARE: f64 = 0.005;

/// A place that lies farther outside another view's silhouette is not the vehicle's, metres: poses are wrong by less,
/// and by no more does a mask's error move its edge.
const DENIED_M: f32 = 0.25;

/// Part of the depth that silhouettes may deny.
const MOST_DENIED: f64 = 0.5;

/// What speaks against a depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Doubt {
    /// Nothing, or there is no depth.
    None,
    /// Between two surfaces, or a surface and nothing: an edge runs on both of its sides.
    Floating,
    /// One of a small patch before or behind the vehicle.
    Stray,
    /// Outside the silhouette in most of the other views that could show it.
    Denied,
}

/// Takes doubtful depths out of `depths`, which belong to `views`, and says which they were. `[view][pixel]`
pub(super) fn doubtful(views: &[View], depths: &mut [DepthMap]) -> Vec<Vec<Doubt>> {
    let mut doubts: Vec<Vec<Doubt>> =
        views.par_iter().zip(&*depths).map(|(view, depth)| loose(view, depth)).collect();
    deny(views, depths, &mut doubts);
    for (depth, doubts) in depths.iter_mut().zip(&doubts) {
        if doubts.iter().any(|doubt| *doubt != Doubt::None) {
            *depth = depth.where_kept(|pixel| doubts[pixel] == Doubt::None);
        }
    }
    doubts
}

/// What a view's own depth tells: floating pixels, then strays among the others.
fn loose(view: &View, depth: &DepthMap) -> Vec<Doubt> {
    let focal = view.camera.intrinsics.smaller_focal() as f32;
    let is_vehicle = |i: usize| view.mask.as_ref().is_none_or(|m| m.labels()[i] == Label::Vehicle);
    let (width, z) = (depth.width() as usize, depth.depth());
    let mut doubts = vec![Doubt::None; z.len()];
    doubts.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for (u, doubt) in row.iter_mut().enumerate() {
            let i = v * width + u;
            if z[i] > 0.0 && is_vehicle(i) && is_floating(depth, u, v, (STEEP_FOOTPRINTS / focal).max(NOISE))
            {
                *doubt = Doubt::Floating;
            }
        }
    });
    let mut vehicle: Vec<bool> = (0..z.len()).map(|i| z[i] > 0.0 && is_vehicle(i)).collect();
    let few = STRAY_SHARE * vehicle.iter().filter(|v| **v).count() as f64;
    vehicle.iter_mut().zip(&doubts).for_each(|(vehicle, doubt)| *vehicle &= *doubt == Doubt::None);
    let (small, large): (Vec<_>, Vec<_>) =
        patches(&vehicle, z, width).into_iter().partition(|patch| (patch.len() as f64) < few);
    let range = |patch: &[usize]| {
        patch.iter().fold((f32::INFINITY, 0.0f32), |(low, high), &i| (low.min(z[i]), high.max(z[i])))
    };
    // Between these, as through a window, a small patch may well be a part of the vehicle.
    let (low, high) = range(&large.concat());
    for patch in small.into_iter().filter(|_| !large.is_empty()) {
        let (near, far) = range(&patch);
        if far < low - LOOSE_M || near > high + LOOSE_M {
            patch.into_iter().for_each(|i| doubts[i] = Doubt::Stray);
        }
    }
    doubts
}

/// Whether, along the rows or along the columns, no neighbour with depth continues the surface, though there is one.
/// `steep` is the change from pixel to pixel that makes an edge, as a share of the depth.
fn is_floating(depth: &DepthMap, u: usize, v: usize, steep: f32) -> bool {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let here = depth.depth()[v * width + u];
    let at = |u: usize, v: usize| {
        let z = (u < width && v < height).then(|| depth.depth()[v * width + u])?;
        (z > 0.0).then(|| (z - here).abs() <= steep * here.min(z))
    };
    let torn = |before: Option<bool>, after: Option<bool>| {
        (before.is_some() || after.is_some()) && !before.unwrap_or(false) && !after.unwrap_or(false)
    };
    let before = |k: usize, at: &dyn Fn(usize) -> Option<bool>| k.checked_sub(1).and_then(at);
    torn(before(u, &|u| at(u, v)), at(u + 1, v)) || torn(before(v, &|v| at(u, v)), at(u, v + 1))
}

/// Pixels that are set and hang together in depth, a list for each patch.
fn patches(set: &[bool], z: &[f32], width: usize) -> Vec<Vec<usize>> {
    let mut seen: Vec<bool> = set.iter().map(|set| !set).collect();
    let mut patches = Vec::new();
    for start in 0..set.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut patch = vec![start];
        let mut next = 0;
        while let Some(&i) = patch.get(next) {
            next += 1;
            let (u, v) = (i % width, i / width);
            for y in v.saturating_sub(1)..(v + 2).min(set.len() / width) {
                for x in u.saturating_sub(1)..(u + 2).min(width) {
                    let neighbour = y * width + x;
                    if !seen[neighbour] && (z[neighbour] - z[i]).abs() <= LOOSE_M {
                        seen[neighbour] = true;
                        patch.push(neighbour);
                    }
                }
            }
        }
        patches.push(patch);
    }
    patches
}

/// What the other views' silhouettes tell. One alone may be cut by something before the vehicle.
///
/// Where they deny most of the depth, it is of another unit or another frame, and no pixel is to blame: all of it stays,
/// for the verdict to tell.
fn deny(views: &[View], depths: &[DepthMap], doubts: &mut [Vec<Doubt>]) {
    let before = doubts.to_vec();
    deny_pixels(views, depths, doubts);
    let of_vehicle = |view: &View, pixel: usize| {
        view.mask.as_ref().is_none_or(|mask| mask.labels()[pixel] == Label::Vehicle)
    };
    let (mut denied, mut measured) = (0usize, 0usize);
    for ((view, depth), doubts) in views.iter().zip(depths).zip(&*doubts) {
        for (pixel, doubt) in doubts.iter().enumerate() {
            let is_measured = depth.depth()[pixel] > 0.0 && of_vehicle(view, pixel);
            measured += usize::from(is_measured && matches!(doubt, Doubt::None | Doubt::Denied));
            denied += usize::from(*doubt == Doubt::Denied);
        }
    }
    if denied as f64 > MOST_DENIED * measured as f64 {
        doubts.clone_from_slice(&before);
    }
}

fn deny_pixels(views: &[View], depths: &[DepthMap], doubts: &mut [Vec<Doubt>]) {
    let shows = |view: &View| view.mask.as_ref().is_some_and(|m| m.vehicle_pixels() > 0);
    let silhouettes: Vec<Option<Silhouette>> =
        views.par_iter().map(|view| shows(view).then(|| Silhouette::new(view))).collect();
    for (i, (view, depth)) in views.iter().zip(depths).enumerate() {
        let width = depth.width() as usize;
        let is_denied = |pixel: usize, z: f32| {
            let place = view.lift((pixel % width) as u32, (pixel / width) as u32, z);
            let others = silhouettes.iter().enumerate().filter(|(j, _)| *j != i);
            let said = others.filter_map(|(_, other)| Some(other.as_ref()?.inside(place)));
            let (mut against, mut with) = (0, 0);
            for inside in said.filter(|inside| inside.is_finite()) {
                *(if inside < -DENIED_M { &mut against } else { &mut with }) += 1;
            }
            against > with
        };
        doubts[i].par_iter_mut().enumerate().for_each(|(pixel, doubt)| {
            let z = depth.depth()[pixel];
            let is_vehicle = view.mask.as_ref().is_none_or(|m| m.labels()[pixel] == Label::Vehicle);
            if *doubt == Doubt::None && z > 0.0 && is_vehicle && is_denied(pixel, z) {
                *doubt = Doubt::Denied;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::RgbImage;

    /// A wall two metres away, `f` = 100 px, and what is drawn over it.
    fn doubts(draw: impl Fn(usize, usize) -> Option<f32>) -> Vec<Doubt> {
        const WIDTH: usize = 60;
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 30.0, cy: 20.0 };
        let view = View {
            name: String::new(),
            camera: Camera::pinhole(60, 40, intrinsics, Pose::IDENTITY).unwrap(),
            image: RgbImage::new(60, 40, vec![[0; 3]; 2400]).unwrap(),
            mask: None,
            depth: None,
        };
        let depth = (0..2400).map(|i| draw(i % WIDTH, i / WIDTH).unwrap_or(2.0)).collect();
        loose(&view, &DepthMap::new(60, 40, depth).unwrap())
    }

    fn columns(doubts: &[Doubt], doubt: Doubt) -> Vec<usize> {
        (0..60).filter(|u| (0..40).any(|v| doubts[60 * v + u] == doubt)).collect()
    }

    #[test]
    fn ramps_between_surfaces_float_and_their_ends_do_not() {
        let found = doubts(|u, _| Some([2.0, 6.0, 10.0, 14.0, 18.0][u.clamp(29, 33) - 29]));
        assert_eq!(columns(&found, Doubt::Floating), [30, 31, 32]);
        assert!(columns(&found, Doubt::Stray).is_empty());
        // Towards nothing, as a resize makes that takes 0 for a depth.
        let found = doubts(|u, _| Some([2.0, 1.5, 0.5, 0.0][u.clamp(29, 32) - 29]));
        assert_eq!(columns(&found, Doubt::Floating), [30, 31]);
    }

    #[test]
    fn slanted_surfaces_noise_and_lone_columns_do_not_float() {
        // 15 footprints from pixel to pixel: 86 degrees.
        assert!(doubts(|u, _| Some(2.0 + 0.3 * u as f32)).iter().all(|d| *d == Doubt::None));
        let noise = |u: usize, v: usize| Some(2.0 + 0.03 * ((u * 37 + v * 91) % 7) as f32 / 7.0);
        assert!(doubts(noise).iter().all(|d| *d == Doubt::None));
        assert!(doubts(|u, _| Some(if u % 2 == 0 { 2.0 } else { 0.0 })).iter().all(|d| *d == Doubt::None));
    }

    #[test]
    fn a_few_pixels_that_hang_loose_are_strays_and_a_part_of_some_size_is_none() {
        let block = |side: usize| {
            doubts(move |u, v| ((20..20 + side).contains(&u) && (10..10 + side).contains(&v)).then_some(60.0))
        };
        for side in [1, 2, 3] {
            let found = block(side);
            let taken: Vec<usize> = (0..2400).filter(|&i| found[i] != Doubt::None).collect();
            let drawn: Vec<usize> =
                (10..10 + side).flat_map(|v| (20..20 + side).map(move |u| 60 * v + u)).collect();
            assert_eq!(taken, drawn, "{side}");
        }
        assert!(block(12).iter().all(|d| *d == Doubt::None));
        // Of the vehicle's own range.
        let seen_through = doubts(|u, v| match (u, v) {
            (20..22, 10..12) => Some(3.0),
            (40.., _) => Some(3.2),
            _ => None,
        });
        assert!(seen_through.iter().all(|d| *d == Doubt::None));
    }
}
