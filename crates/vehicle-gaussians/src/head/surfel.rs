//! The weight-free head: one flat Gaussian per kept pixel, in the surface that the depth map describes.
//!
//! In-plane it is as large as the pixel's footprint on the surface, so that its projection into its own view
//! is a circle of [`FOOTPRINT_SIGMA_PX`] whatever the obliquity; across the surface it is thin. Its colour
//! comes from all views that see the place (see [`super::appearance`]); if no other view sees it, it is the
//! pixel's own, RGB2SH(I).

use super::GaussianHead;
use super::appearance::{self, Sample};
use crate::prior::Geometry;
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use vg_geometry::Result;
use vg_geometry::progress::Context;
use vg_scene::View;
use vg_scene::visibility::{Observer, SURFACE_M, Sight};
use vg_splat::gaussians::buffer::Gaussian;
use vg_splat::gaussians::{Gaussians, sh};

/// Standard deviation of a surfel seen from its own camera, pixels. With the renderer's blur of 0.3 px^2,
/// neighbours one pixel apart overlap to a smooth surface without spilling over the silhouette; at twice the
/// magnification, where the blur matters less, the surface is still closed.
pub const FOOTPRINT_SIGMA_PX: f32 = 0.5;

/// Thickness over in-plane size.
const THICKNESS: f32 = 0.2;

/// Maximum stretch of a footprint along the tilt: the slope of a surface seen at a grazing angle is uncertain.
const MAX_STRETCH: f32 = 4.0;

/// Peak opacity.
const OPACITY: f32 = 0.9;

/// Minimum weight of a view: its colour is useful even at a fraction of the resolution.
const MIN_WEIGHT: f32 = 0.3;

/// See the module's documentation.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfelHead {
    sh_degree: u8,
}

impl SurfelHead {
    /// A head with colour up to SH degree `sh_degree`, 0 to 3.
    pub fn new(sh_degree: u8) -> Self {
        Self { sh_degree }
    }
}

impl GaussianHead for SurfelHead {
    fn name(&self) -> &'static str {
        "surfel"
    }

    fn predict(
        &self,
        views: &[View],
        geometry: &Geometry,
        kept: &[Vec<bool>],
        context: &Context,
    ) -> Result<Gaussians> {
        let count = kept.iter().flatten().filter(|k| **k).count();
        let mut all = Gaussians::with_capacity(self.sh_degree, count);
        let coefficients = all.sh_stride();
        let observers = geometry.observers(views);
        for (i, view) in views.iter().enumerate() {
            let surfels: Vec<(Gaussian, [f32; 48])> = context.parallel(|| {
                (0..kept[i].len())
                    .into_par_iter()
                    .filter(|&pixel| kept[i][pixel])
                    .filter_map(|pixel| {
                        let (surfel, normal) = surfel(view, geometry, i, pixel)?;
                        let color = self.color(&observers, i, &surfel, normal);
                        Some((surfel, color))
                    })
                    .collect()
            });
            for (surfel, sh) in &surfels {
                all.push_with_sh(surfel, &sh[..coefficients]);
            }
            context.report("head", (i + 1) as f64 / views.len() as f64)?;
        }
        Ok(all)
    }
}

impl SurfelHead {
    /// The colour fitted to the surfel's own view and to all others that see its place.
    fn color(&self, observers: &[Observer], own: usize, surfel: &Gaussian, normal: Vec3) -> [f32; 48] {
        let place = Vec3::from_array(surfel.mean);
        let own_resolution = observers[own].resolution(place, normal).max(1e-3);
        let mut samples = [Sample::default(); appearance::MAX_SAMPLES];
        samples[0] = Sample {
            direction: (place - observers[own].center).normalize_or(Vec3::X),
            color: Vec3::from_array(sh::to_rgb(surfel.sh0)),
            weight: 1.0,
        };
        let mut n = 1;
        for (j, observer) in observers.iter().enumerate() {
            if j == own || n == samples.len() {
                continue;
            }
            let resolution = observer.resolution(place, normal);
            if resolution > 0.0 && observer.sight(place, SURFACE_M) == Sight::Surface {
                samples[n] = Sample {
                    direction: (place - observer.center).normalize_or(Vec3::X),
                    color: observer.color_at(place),
                    weight: (resolution / own_resolution).clamp(MIN_WEIGHT, 1.0),
                };
                n += 1;
            }
        }
        appearance::fit(&samples[..n], self.sh_degree)
    }
}

/// The surfel of a pixel with the pixel's colour, and its normal in the vehicle frame.
fn surfel(view: &View, geometry: &Geometry, i: usize, pixel: usize) -> Option<(Gaussian, Vec3)> {
    let camera = &view.camera;
    let (u, v) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
    let z = geometry.depths[i].get(u, v)?;
    let normal = geometry.normals[i][pixel];
    let ray = camera.intrinsics.pixel_ray(u, v).as_vec3();
    let direction = ray.normalize();

    let cos = normal.dot(-direction).max(1.0 / MAX_STRETCH);
    // Along the tilt the footprint is stretched by 1 / cos; across it, it is the pixel's.
    let tilt = normal.cross(direction).cross(normal);
    let along = tilt.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    let across = normal.cross(along);
    let focal = camera.intrinsics.smaller_focal() as f32;
    let size = FOOTPRINT_SIGMA_PX * z * ray.length() / focal;

    let vehicle_from_camera = camera.vehicle_from_camera.rotation.as_mat3();
    let q = Quat::from_mat3(&(vehicle_from_camera * Mat3::from_cols(along, across, normal))).normalize();
    let surfel = Gaussian {
        mean: view.lift(u, v, z).to_array(),
        rotation: [q.w, q.x, q.y, q.z],
        scale: [size / cos, size, size * THICKNESS],
        opacity: OPACITY,
        sh0: sh::from_rgb(view.image.pixels()[pixel].map(|c| f32::from(c) / 255.0)),
    };
    // A depth of 1e-40 m or a principal point 1e9 px away exceeds the range of a Gaussian.
    surfel.is_storable().then(|| (surfel, vehicle_from_camera * normal))
}
