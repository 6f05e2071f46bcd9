//! The decision where to clone: whether a view observed the mirrored place of a Gaussian, and how well.

use super::relight::{Light, Relight, Relighting};
use super::{Completion, MirrorClone, MirroredPlace, SymmetryMode, complete};
use crate::head::surfel::FOOTPRINT_SIGMA_PX;
use crate::prior::Geometry;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use vg_scene::View;
use vg_scene::visibility::{Observer, SURFACE_M, Sight};
use vg_splat::Gaussians;

/// Ratio of resolutions from which another view, or a mirror image, replaces an observation. At 1, gaps open where the
/// grid of Gaussians of one view ends and that of another begins.
pub(crate) const BETTER: f32 = 1.03;

/// A vehicle with both sides.
pub(crate) struct Completed {
    /// Originals, then clones.
    pub(crate) gaussians: Gaussians,
    /// Counts of cloned and replaced Gaussians.
    pub(crate) completion: Completion,
    /// The original of each clone, and the factor on its colour.
    pub(crate) clones: Vec<MirrorClone>,
    /// The light that the clones are shown in, where it was estimated.
    pub(crate) relighting: Option<Relighting>,
}

impl Completed {
    /// Clones the observed `gaussians` by the rule of `mode`, and shows the clones in the light of their own side. The
    /// plane of symmetry of `views` is y = 0.
    pub(crate) fn new(
        gaussians: Gaussians,
        mode: SymmetryMode,
        relight: Relight,
        views: &[View],
        geometry: &Geometry,
    ) -> Self {
        // From the observed Gaussians alone: clones carry the light of the wrong side.
        let light = match (relight, mode) {
            (Relight::Never, _) | (_, SymmetryMode::Never | SymmetryMode::Flip) => None,
            (Relight::Auto, _) => Light::estimate(&gaussians),
        };
        let cameras: Vec<_> = views.iter().map(|v| v.camera).collect();
        let (mut gaussians, completion, originals) =
            complete(gaussians, mode, &cameras, |gaussians| mirrored_places(gaussians, views, geometry));
        let clones = gaussians.len() - completion.cloned..gaussians.len();
        let (relighting, gains) = light.map(|light| light.apply(&mut gaussians, clones)).unzip();
        let gain = |k: usize| gains.as_ref().map_or([1.0; 3], |gains| gains[k]);
        let clones = originals.iter().enumerate().map(|(k, &of)| MirrorClone { of, gain: gain(k) }).collect();
        Self { gaussians, completion, clones, relighting }
    }
}

/// How well the views observed the mirrored place of each surfel.
fn mirrored_places(gaussians: &Gaussians, views: &[View], geometry: &Geometry) -> Vec<MirroredPlace> {
    let observers = geometry.observers(views);
    (0..gaussians.len()).into_par_iter().map(|i| mirrored_place(&observers, gaussians, i)).collect()
}

/// How well the mirrored place of surfel `i` was observed: it was, where a view saw a surface there, or saw through it
/// to another surface. Background is no evidence: with poses a pixel off, the rim of every mirror image lies in it.
fn mirrored_place(observers: &[Observer], gaussians: &Gaussians, i: usize) -> MirroredPlace {
    let (place, normal, own) = mirrored_surfel(gaussians, i);
    let mut mirrored = MirroredPlace::Unseen;
    for observer in observers {
        // Most views show the other side: they need no look-up.
        let resolution = observer.resolution(place, normal);
        if resolution <= own / BETTER {
            continue;
        }
        match observer.sight(place, SURFACE_M) {
            Sight::Surface if resolution > BETTER * own => return MirroredPlace::SeenBetter,
            Sight::Surface | Sight::Through => mirrored = MirroredPlace::Seen,
            Sight::Background | Sight::Silent => {}
        }
    }
    mirrored
}

/// Centre and normal of the mirror image of surfel `i`, and the resolution at which the original was seen.
fn mirrored_surfel(gaussians: &Gaussians, i: usize) -> (Vec3, Vec3, f32) {
    let flip = Vec3::new(1.0, -1.0, 1.0);
    let [w, x, y, z] = gaussians.rotations()[i];
    let normal = Quat::from_xyzw(x, y, z, w) * Vec3::Z;
    let coarsest = gaussians.scales()[i].into_iter().fold(0.0, f32::max);
    (Vec3::from_array(gaussians.means()[i]) * flip, normal * flip, FOOTPRINT_SIGMA_PX / coarsest)
}
