//! The guard: finds given or predicted depths that lie on no surface of the vehicle.
//!
//! Sensors, networks and resampling mix two surfaces in one pixel at a depth edge, or a surface and missing depth, and
//! a few such pixels make a vehicle many times its size. Priors that estimate a closed surface do not produce them.

use crate::prior::volume::Silhouette;
use rayon::prelude::*;
use vg_scene::mask::Label;
use vg_scene::{DepthMap, View};

/// Change of depth from pixel to pixel of a surface seen at 87 degrees, pixel footprints; a larger change is an edge.
const STEEP_FOOTPRINTS: f32 = 20.0;

/// Upper bound of a sensor's noise from pixel to pixel, as a share of the depth.
const NOISE: f32 = 0.02;

/// Largest step in depth within a connected patch, metres.
const LOOSE_M: f32 = 0.5;

/// A separate patch of depth that is nearer or farther than all large patches is a stray below this share of the
/// vehicle's pixels.
const STRAY_SHARE: f64 = 0.005;

/// A place farther outside another view's silhouette is not on the vehicle, metres: errors of poses and masks move the
/// edges by less.
const DENIED_M: f32 = 0.25;

/// Largest share of the depth that silhouettes may reject.
const MOST_DENIED: f64 = 0.5;

/// The reason to reject a depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Doubt {
    /// No doubt, or no depth.
    None,
    /// Between two surfaces, or a surface and missing depth: there is an edge on both sides.
    Floating,
    /// In a small patch in front of or behind the vehicle.
    Stray,
    /// Outside the silhouette in most of the other views that could show it.
    Denied,
}

/// Removes doubtful depths from `depths`, one map per view, and returns the reasons. `[view][pixel]`
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

/// Doubts from a view's own depth: floating pixels, then strays among the others.
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
    // A small patch between these, as behind a window, can be a part of the vehicle.
    let (low, high) = range(&large.concat());
    for patch in small.into_iter().filter(|_| !large.is_empty()) {
        let (near, far) = range(&patch);
        if far < low - LOOSE_M || near > high + LOOSE_M {
            patch.into_iter().for_each(|i| doubts[i] = Doubt::Stray);
        }
    }
    doubts
}

/// Whether, along the row or the column, there are neighbours with depth and none continues the surface. `steep` is the
/// change from pixel to pixel that makes an edge, as a share of the depth.
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

/// Connected patches of set pixels without steps in depth, as lists of pixels.
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

/// Doubts from the silhouettes of the other views, by majority: an object in front of the vehicle may cut a single one.
///
/// Where they reject most of the depth, it is in another unit or frame and no pixel is to blame. All of it is kept
/// then, and the verdict reports the contradiction.
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

    /// The doubts for a wall two metres away, f = 100 px, with `draw` over it.
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
        // Towards missing depth, as a resize makes that interpolates the 0.
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
    fn a_few_separate_pixels_are_strays_and_a_larger_part_is_not() {
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
        // Within the depth range of the vehicle.
        let seen_through = doubts(|u, v| match (u, v) {
            (20..22, 10..12) => Some(3.0),
            (40.., _) => Some(3.2),
            _ => None,
        });
        assert!(seen_through.iter().all(|d| *d == Doubt::None));
    }
}
