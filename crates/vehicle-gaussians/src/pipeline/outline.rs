//! Masks for views that have none, from depth that was measured on the vehicle and nowhere else.

use super::options::PriorChoice;
use super::plan::note;
use super::report::LeftOut;
use vg_geometry::{Error, Result};
use vg_scene::mask::{Label, Mask};
use vg_scene::{DepthMap, Scene, View};

/// The scene with a mask for each of the `used` views. Silhouette priors refuse a view without, in words of their own;
/// where depth tells the surface, all of the photograph would become vehicle.
pub(super) fn masked(
    scene: &Scene,
    used: &[usize],
    prior: PriorChoice,
    left_out: &mut Vec<LeftOut>,
) -> Result<Scene> {
    let mut scene = scene.clone();
    let mut filled = 0;
    for &i in used.iter().filter(|_| matches!(prior, PriorChoice::Given | PriorChoice::Onnx)) {
        let view = &scene.views[i];
        if view.mask.is_some() {
            continue;
        }
        let argument = format!("{}.mask", view.argument(i));
        let outline = view.depth.as_ref().filter(|_| prior == PriorChoice::Given).map(outline);
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

/// Vehicle where depth was measured, background around it, unknown in its holes; `None` where the picture's border
/// was measured too, or nothing was.
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
    // From the border inwards: all of it hangs together.
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
    fn what_was_measured_is_vehicle_its_holes_are_unknown_and_the_rest_is_background() {
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
    fn depth_at_the_border_and_no_depth_are_no_outline() {
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
