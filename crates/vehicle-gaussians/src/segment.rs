//! Masks from a network, for views without one: contract "segmentation", version 1 (docs/ONNX.md).
//!
//! The network marks the pixels of all vehicles. The pose determines which vehicle to reconstruct: the one at the
//! origin of the vehicle frame. Cars next to it and behind it become background.

use glam::DVec3;
use rayon::prelude::*;
use vg_geometry::{Camera, Error, Result};
use vg_scene::fit::Fit;
use vg_scene::framing::{Framing, Resize};
use vg_scene::mask::{Label, Mask};
use vg_scene::onnx::{Broken, Input, Model, Ports};
use vg_scene::{RgbImage, View};

/// Minimum probability of vehicle pixels.
const PROBABLE: f32 = 0.5;

/// Largest distance from the origin of the vehicle frame to rays that can show the vehicle, metres: half the diagonal
/// of a large van. For longer vehicles this still covers most pixels.
const REACH_M: f64 = 3.0;

/// Largest gap between pieces of one vehicle, as a share of the largest piece's diagonal: a tree hides less of a car,
/// and the gap between two parked cars is wider.
const GAP_SHARE: f64 = 0.08;

/// Area, as a share of the vehicle, up to which holes are filled: one pixel of background is a hole through the hull.
const HOLE_SHARE: f64 = 0.02;

/// A segmentation network. Clones share the open model.
#[derive(Clone, Debug)]
pub struct Segmenter {
    model: Model,
    framing: Framing,
    name: String,
    /// Index among the outputs.
    mask: usize,
}

impl Segmenter {
    /// A segmenter that runs `model`; [`Error::Format`] names what breaks the contract.
    pub fn new(model: Model) -> Result<Self> {
        let (framing, name, mask) =
            Self::read(model.ports()).map_err(|broken| model.broken(broken.field, broken.reason))?;
        Ok(Self { model, framing, name, mask })
    }

    /// The network's name, from its metadata.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn read(ports: &Ports) -> std::result::Result<(Framing, String, usize), Broken> {
        ports.one_of("vg.contract", &[("1", ())], None)?;
        for (key, what) in [("vg.prior", "a geometry prior"), ("vg.head", "a Gaussian head")] {
            if let Some(name) = ports.metadata.get(key) {
                return Err(Broken::new(
                    format!("metadata {key}"),
                    format!("{name:?}: {what}, not a segmentation network"),
                ));
            }
        }
        let name = ports.required("vg.mask")?.to_owned();
        let framing = Framing::read(ports, Resize::Stretch)?;
        if let Some(n) = framing.views.filter(|n| *n != 1) {
            let reason =
                format!("{n} views per run; allowed: 1 or any number, since views are segmented one by one");
            return Err(Broken::new("input images", reason));
        }
        let images = ports.required_input("images", &[None, Some(3), None, None])?;
        ports.no_inputs_but(&["images"])?;
        let mask = ports.required_output("mask", &[framing.views, images[2], images[3]])?;
        Ok((framing, name, mask))
    }

    /// The mask of the vehicle at the origin of the camera's vehicle frame; empty if the network finds no vehicle
    /// there. Pixels outside the network's crop are unknown. Runs in the rayon pool it is called from.
    ///
    /// # Errors
    /// [`Error::Argument`] for a picture that does not have the camera's size, or has an aspect ratio far from the
    /// network's; [`Error::Format`] if an output of the network breaks the contract.
    pub fn mask(&self, image: &RgbImage, camera: &Camera) -> Result<Mask> {
        camera.validate("camera")?;
        let (width, height) = (camera.width, camera.height);
        let found = || format!("{}x{}", image.width(), image.height());
        if (image.width(), image.height()) != (width, height) {
            return Err(Error::argument("image", found(), format!("the camera's size, {width}x{height}")));
        }
        let size = self.framing.size_for(f64::from(width) / f64::from(height));
        let fit = Fit::new(width, height, size, self.framing.resize).ok_or_else(|| {
            let allowed = format!("an aspect ratio nearer to the network's {} x {}", size.0, size.1);
            Error::argument("image", found(), allowed)
        })?;
        let probabilities = self.run(image, &fit)?;
        let labels: Vec<Label> = (0..width as usize * height as usize)
            .into_par_iter()
            .map(|pixel| match fit.taps(pixel, width) {
                None => Label::Unknown,
                Some(taps) if taps.blend(taps.index.map(|i| probabilities[i])) >= PROBABLE => Label::Vehicle,
                Some(_) => Label::Background,
            })
            .collect();
        Mask::new(width, height, select_vehicle(labels, camera))
    }

    /// Adds masks to the views that have none; returns the number of these views. An error names the view.
    pub fn fill(&self, views: &mut [View]) -> Result<usize> {
        let mut filled = 0;
        for (i, view) in views.iter_mut().enumerate().filter(|(_, view)| view.mask.is_none()) {
            let mask = self.mask(&view.image, &view.camera).map_err(|error| match error {
                Error::Argument { argument, found, allowed } => {
                    Error::argument(format!("{}.{argument}", view.argument(i)), found, allowed)
                }
                other => other,
            })?;
            view.mask = Some(mask);
            filled += 1;
        }
        Ok(filled)
    }

    /// Runs the network; returns probabilities at the network's size.
    fn run(&self, image: &RgbImage, fit: &Fit) -> Result<Vec<f32>> {
        let (width, height) = (fit.size.0 as usize, fit.size.1 as usize);
        let picture = fit.picture(image, &self.framing);
        let input = Input { name: "images", shape: &[1, 3, height, width], data: &picture };
        let mut outputs = self.model.run(&[input])?;
        let mask = self.model.output(&mut outputs, self.mask, &[1, height, width])?;
        match mask.iter().find(|p| !(0.0..=1.0).contains(*p)) {
            Some(p) => {
                Err(self.model.broken("output mask", format!("the network returned {p}; allowed: 0 to 1")))
            }
            None => Ok(mask),
        }
    }
}

/// Keeps the vehicle at the origin, without small holes, and makes other vehicles background.
fn select_vehicle(mut labels: Vec<Label>, camera: &Camera) -> Vec<Label> {
    let width = camera.width as usize;
    let center = camera.vehicle_from_camera.inverse().translation;
    let is_near = |pixel: usize| passes_near(camera, pixel, center);
    let patches = patches(&labels, width, Label::Vehicle);
    // The number of pixels of each patch that can show the vehicle.
    let near: Vec<usize> = patches.par_iter().map(|p| p.iter().filter(|&&i| is_near(i)).count()).collect();
    let best = (0..patches.len()).max_by_key(|&k| (near[k], std::cmp::Reverse(k))).filter(|&k| near[k] > 0);
    let bounds: Vec<[usize; 4]> = patches.iter().map(|patch| bounds(patch, width)).collect();
    // Posts and trees divide a vehicle into pieces.
    let is_piece = |k: usize, best: usize| {
        2 * near[k] > patches[k].len() && gap(bounds[k], bounds[best]) <= GAP_SHARE * diagonal(bounds[best])
    };
    let mut size = 0;
    for (k, patch) in patches.iter().enumerate() {
        if best.is_some_and(|best| k == best || is_piece(k, best)) {
            size += patch.len();
        } else {
            patch.iter().for_each(|&i| labels[i] = Label::Background);
        }
    }
    let largest = (HOLE_SHARE * size as f64) as usize;
    for hole in self::patches(&labels, width, Label::Background) {
        let is_inside = |&i: &usize| {
            let (u, v) = (i % width, i / width);
            let neighbours = [i.wrapping_sub(1), i + 1, i.wrapping_sub(width), i + width];
            let at_border = u == 0 || u + 1 == width || v == 0 || i + width >= labels.len();
            !at_border && neighbours.iter().all(|&n| labels[n] != Label::Unknown)
        };
        if hole.len() <= largest && hole.iter().all(is_inside) {
            hole.iter().for_each(|&i| labels[i] = Label::Vehicle);
        }
    }
    labels
}

/// Whether a pixel's ray passes `center`, a point in the camera frame, within [`REACH_M`].
fn passes_near(camera: &Camera, pixel: usize, center: DVec3) -> bool {
    let (u, v) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
    let Some(ray) = camera.ray([f64::from(u) + 0.5, f64::from(v) + 0.5]) else { return false };
    let ray = ray.normalize();
    let along = ray.dot(center);
    // A camera within reach may see the vehicle in every direction.
    let closest = center - ray * along.max(0.0);
    closest.length() <= REACH_M
}

/// First and last column and row of a patch: `[u0, v0, u1, v1]`.
fn bounds(patch: &[usize], width: usize) -> [usize; 4] {
    patch.iter().fold([usize::MAX, usize::MAX, 0, 0], |[u0, v0, u1, v1], i| {
        let (u, v) = (i % width, i / width);
        [u0.min(u), v0.min(v), u1.max(u), v1.max(v)]
    })
}

/// Pixels between two boxes, along the axis with the wider gap.
fn gap(a: [usize; 4], b: [usize; 4]) -> f64 {
    let between = |k: usize| {
        let apart = a[k].saturating_sub(b[k + 2]).max(b[k].saturating_sub(a[k + 2]));
        apart.saturating_sub(1) as f64
    };
    between(0).max(between(1))
}

fn diagonal([u0, v0, u1, v1]: [usize; 4]) -> f64 {
    ((u1 - u0) as f64).hypot((v1 - v0) as f64)
}

/// 4-connected components of a label, each a list of pixels, in the order of their first pixels.
fn patches(labels: &[Label], width: usize, label: Label) -> Vec<Vec<usize>> {
    let mut seen = vec![false; labels.len()];
    let mut patches = Vec::new();
    for start in 0..labels.len() {
        if seen[start] || labels[start] != label {
            continue;
        }
        seen[start] = true;
        let mut patch = vec![start];
        let mut next = 0;
        while next < patch.len() {
            let i = patch[next];
            next += 1;
            let (u, last) = (i % width, width - 1);
            let sides = [
                (u > 0).then(|| i - 1),
                (u < last).then(|| i + 1),
                (i >= width).then(|| i - width),
                (i + width < labels.len()).then(|| i + width),
            ];
            for side in sides.into_iter().flatten() {
                if !seen[side] && labels[side] == label {
                    seen[side] = true;
                    patch.push(side);
                }
            }
        }
        patches.push(patch);
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use vg_geometry::{Intrinsics, Pose};

    const WIDTH: u32 = 80;
    const HEIGHT: u32 = 60;

    /// Seven metres to the right of the vehicle, looking at it.
    fn camera() -> Camera {
        let rotation = DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y);
        let pose = Pose::new("pose", rotation, DVec3::new(0.0, -7.0, 0.5)).unwrap();
        let intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 40.0, cy: 30.0 };
        Camera::pinhole(WIDTH, HEIGHT, intrinsics, pose).unwrap()
    }

    /// Labels from a drawing with ten by ten pixels per character.
    fn drawn(rows: [&str; 6]) -> Vec<Label> {
        let character = |i: u32| rows[(i / WIDTH / 10) as usize].as_bytes()[(i % WIDTH / 10) as usize];
        let label = |i: u32| match character(i) {
            b'#' => Label::Vehicle,
            b'?' => Label::Unknown,
            _ => Label::Background,
        };
        (0..WIDTH * HEIGHT).map(label).collect()
    }

    #[test]
    fn other_cars_become_background() {
        let made = select_vehicle(
            drawn(["#.......", "........", ".####..#", ".####..#", "........", "........"]),
            &camera(),
        );
        assert!(made == drawn(["........", "........", ".####...", ".####...", "........", "........"]));
    }

    #[test]
    fn a_post_before_the_vehicle_leaves_both_pieces() {
        let mut pieces = drawn(["........", "........", ".######.", ".######.", "........", "........"]);
        for v in 20..40 {
            pieces[v * WIDTH as usize + 40..][..2].fill(Label::Background);
        }
        assert!(select_vehicle(pieces.clone(), &camera()) == pieces);
        // A gap of ten pixels separates two cars.
        let two = drawn(["........", "........", "#.#####.", "#.#####.", "........", "........"]);
        assert!(
            select_vehicle(two, &camera())
                == drawn(["........", "........", "..#####.", "..#####.", "........", "........"])
        );
    }

    #[test]
    fn small_holes_are_filled_and_large_ones_kept() {
        let mut labels = drawn(["........", ".######.", ".##.###.", ".######.", "........", "........"]);
        let kept = labels.clone();
        let pinhole = 25 * WIDTH as usize + 55;
        labels[pinhole] = Label::Background;
        assert!(select_vehicle(labels, &camera()) == kept);
    }

    #[test]
    fn a_long_vehicle_is_kept_whole_and_none_is_none() {
        let long = drawn(["........", "........", "########", "########", "........", "........"]);
        assert!(select_vehicle(long.clone(), &camera()) == long);
        let none = drawn(["........"; 6]);
        assert!(select_vehicle(none.clone(), &camera()) == none);
        // A camera that looks the other way has nothing within reach.
        let away =
            Pose::new("pose", DMat3::from_cols(-DVec3::X, -DVec3::Z, -DVec3::Y), DVec3::new(0.0, -7.0, 0.5));
        let away = Camera { vehicle_from_camera: away.unwrap(), ..camera() };
        assert!(select_vehicle(long, &away) == none);
    }

    #[test]
    fn cropped_pixels_stay_unknown_and_make_no_hole() {
        let labels = drawn(["????????", ".######.", ".######.", ".######.", "........", "????????"]);
        assert!(select_vehicle(labels.clone(), &camera()) == labels);
    }
}
