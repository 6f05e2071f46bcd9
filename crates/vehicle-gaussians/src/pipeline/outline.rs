//! Masks for views that have none, from depth that was measured on the vehicle only.

use super::options::PriorChoice;
use super::plan::note;
use super::prior::Source;
use super::report::LeftOut;
use vg_geometry::{Error, Result};
use vg_scene::mask::{Label, Mask};
use vg_scene::{DepthMap, Scene, View};

/// The scene with a mask for each of the `used` views that needs one. Priors that work from silhouettes refuse a view
/// without a mask themselves; with depth per pixel, all of the photograph would become vehicle.
pub(super) fn masked(
    scene: &Scene,
    used: &[usize],
    source: &Source,
    left_out: &mut Vec<LeftOut>,
) -> Result<Scene> {
    let mut scene = scene.clone();
    let mut filled = 0;
    let is_given = matches!(source, Source::BuiltIn(PriorChoice::Given));
    for &i in used.iter().filter(|_| source.is_per_pixel()) {
        let view = &scene.views[i];
        if view.mask.is_some() {
            continue;
        }
        let argument = format!("{}.mask", view.argument(i));
        let outline = view.depth.as_ref().filter(|_| is_given).map(outline);
        match outline {
            Some(Some(mask)) => scene.views[i] = View { mask: Some(mask), ..scene.views[i].clone() },
            Some(None) => {
                return Err(Error::argument(
                    argument,
                    "none, and its depth reaches the picture's border or measures nothing, so that it does not tell the vehicle from what is around it",
                    "a mask, an alpha channel, or depth that is 0 outside the vehicle",
                ));
            }
            None => {
                return Err(Error::argument(
                    argument,
                    "none, so that all of the photograph would be vehicle",
                    "a mask, an alpha channel, or a segmentation network's mask (mask model)",
                ));
            }
        }
        filled += 1;
    }
    note(left_out, "masks", "none was given: the outline of the view's depth is taken", filled);
    Ok(scene)
}

/// Vehicle where depth was measured, background around it, unknown in its holes; `None` where depth reaches the image
/// border or was measured nowhere.
fn outline(depth: &DepthMap) -> Option<Mask> {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let z = depth.depth();
    let is_border = |i: usize| {
        let (u, v) = (i % width, i / width);
        u == 0 || v == 0 || u + 1 == width || v + 1 == height
    };
    if z.iter().all(|z| *z <= 0.0) || (0..z.len()).any(|i| is_border(i) && z[i] > 0.0) {
        return None;
    }
    let mut labels: Vec<Label> =
        z.iter().map(|z| if *z > 0.0 { Label::Vehicle } else { Label::Unknown }).collect();
    // The border is connected: flood the background from one of its pixels.
    let mut open = vec![0];
    labels[0] = Label::Background;
    while let Some(i) = open.pop() {
        let (u, v) = (i % width, i / width);
        let sides = [
            (u > 0).then(|| i - 1),
            (u + 1 < width).then(|| i + 1),
            (v > 0).then(|| i - width),
            (v + 1 < height).then(|| i + width),
        ];
        for side in sides.into_iter().flatten() {
            if labels[side] == Label::Unknown {
                labels[side] = Label::Background;
                open.push(side);
            }
        }
    }
    Mask::new(depth.width(), depth.height(), labels).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measured_pixels_are_vehicle_their_holes_are_unknown_and_the_rest_is_background() {
        let drawing = [".......", "..###..", "..#.#..", "..###..", "......."].concat();
        let depth = drawing.bytes().map(|c| if c == b'#' { 3.0 } else { 0.0 }).collect();
        let mask = outline(&DepthMap::new(7, 5, depth).unwrap()).unwrap();
        let seen: String = mask
            .labels()
            .iter()
            .map(|label| match label {
                Label::Vehicle => '#',
                Label::Unknown => '?',
                Label::Background => '.',
            })
            .collect();
        assert_eq!(seen, [".......", "..###..", "..#?#..", "..###..", "......."].concat());
    }

    #[test]
    fn depth_that_reaches_the_border_or_is_missing_gives_no_outline() {
        let map = |at: Option<usize>| {
            let depth = (0..35).map(|i| if at == Some(i) { 3.0 } else { 0.0 }).collect();
            outline(&DepthMap::new(7, 5, depth).unwrap())
        };
        assert!(map(Some(8)).is_some());
        for border in [0, 3, 7, 13, 30, 34] {
            assert!(map(Some(border)).is_none(), "{border}");
        }
        assert!(map(None).is_none());
    }
}
