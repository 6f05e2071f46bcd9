//! All metrics of one render against its photograph, and their means over views.

use super::{on_white, psnr, psnr_in, silhouette_iou, ssim};
use serde::Serialize;
use vg_geometry::progress::Threads;
use vg_geometry::{Result, measures};
use vg_scene::{Scene, View};
use vg_splat::Gaussians;
use vg_splat::render::{CpuRenderer, RenderOptions, Rendered};

measures! {
    /// Error of one render on white, or the means over several; `None` where a measure does not exist.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct ViewErrors {
        /// Peak signal-to-noise ratio over the full frame, dB; infinite for equal pictures.
        pub psnr_db: f64 => ("PSNR dB", 3, Higher),
        /// Structural similarity over the full frame, at most 1; `None` for a picture smaller than 11x11.
        pub ssim: Option<f64> => ("SSIM", 4, Higher),
        /// Peak signal-to-noise ratio inside the bounding box of the mask, dB; `None` where the mask is empty.
        pub psnr_box_db: Option<f64> => ("PSNR box", 3, Higher),
        /// Intersection over union of the mask and the pixels that the model covers by half or more, 0 to 1.
        pub silhouette_iou: f64 => ("IoU", 4, Higher),
        /// Mean absolute difference of depth where the view has depth and the model covers the pixel by half or more,
        /// metres; `None` where that is nowhere.
        pub depth_mae_m: Option<f64> => ("depth MAE m", 4, Lower),
        /// 90th percentile of that difference, metres.
        pub depth_p90_m: Option<f64> => ("", 4, Lower),
    }
}

impl ViewErrors {
    /// The errors of a picture drawn by the view's camera on white, with expected depth.
    pub fn of(rendered: &Rendered, view: &View) -> Self {
        let truth = on_white(view);
        let width = rendered.width;
        let bounds = match &view.mask {
            Some(mask) => mask.bounds(),
            None => Some([0, 0, width - 1, rendered.height - 1]),
        };
        let depth = depth_differences(rendered, view);
        Self {
            psnr_db: psnr(&rendered.color, &truth),
            ssim: ssim(&rendered.color, &truth, width, rendered.height),
            psnr_box_db: bounds.map(|b| psnr_in(&rendered.color, &truth, width, b)),
            silhouette_iou: silhouette_iou(&rendered.alpha, view),
            depth_mae_m: mean(depth.iter().copied()),
            depth_p90_m: percentile_90(depth),
        }
    }

    /// The errors of a model in every view of a scene, in their order, drawn by the CPU on white.
    ///
    /// # Errors
    /// The scene is invalid.
    pub fn of_scene(gaussians: &Gaussians, scene: &Scene, threads: &Threads) -> Result<Vec<Self>> {
        scene.validate()?;
        let renderer = CpuRenderer::new();
        let mut drawn = Rendered::default();
        let mut of = |view: &View| {
            renderer.render_into(gaussians, &view.camera, &RenderOptions::default(), &mut drawn)?;
            Ok(Self::of(&drawn, view))
        };
        threads.run(|| scene.views.iter().map(&mut of).collect())
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), v| (sum + v, n + 1));
    (n > 0).then(|| sum / n as f64)
}

/// Absolute differences of depth at pixels where both the render and the view show the vehicle; errors of the outline
/// are left to the IoU.
fn depth_differences(rendered: &Rendered, view: &View) -> Vec<f64> {
    let Some(truth) = view.depth.as_ref().map(vg_scene::DepthMap::depth) else { return Vec::new() };
    let pixels = truth.iter().zip(&rendered.depth).zip(&rendered.alpha);
    let both = pixels.filter(|((truth, _), alpha)| **truth > 0.0 && **alpha >= 0.5);
    both.map(|((truth, drawn), _)| f64::from(truth - drawn).abs()).collect()
}

/// The smallest value that nine tenths of all do not exceed; `None` for no values.
fn percentile_90(mut values: Vec<f64>) -> Option<f64> {
    let rank = (9 * values.len()).div_ceil(10).checked_sub(1)?;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::{DepthMap, Mask, RgbImage};

    fn view(depth: Option<Vec<f32>>) -> View {
        let i = Intrinsics { fx: 1.0, fy: 1.0, cx: 1.0, cy: 0.5 };
        View {
            name: String::new(),
            camera: Camera::pinhole(2, 1, i, Pose::IDENTITY).unwrap(),
            image: RgbImage::new(2, 1, vec![[255, 0, 0], [9, 9, 9]]).unwrap(),
            mask: Some(Mask::from_strided("mask", &[255, 0], 2, 1, 2).unwrap()),
            depth: depth.map(|d| DepthMap::new(2, 1, d).unwrap()),
        }
    }

    fn drawn() -> Rendered {
        Rendered {
            width: 2,
            height: 1,
            color: vec![[1.0, 0.0, 0.0], [1.0; 3]],
            alpha: vec![1.0, 0.0],
            depth: vec![2.5, 7.0],
        }
    }

    #[test]
    fn a_perfect_render_has_no_error_and_background_depth_does_not_count() {
        let errors = ViewErrors::of(&drawn(), &view(Some(vec![2.0, 1.0])));
        assert_eq!((errors.psnr_db, errors.psnr_box_db), (f64::INFINITY, Some(f64::INFINITY)));
        assert_eq!((errors.silhouette_iou, errors.ssim), (1.0, None));
        assert_eq!((errors.depth_mae_m, errors.depth_p90_m), (Some(0.5), Some(0.5)));
    }

    #[test]
    fn nine_tenths_do_not_exceed_the_percentile() {
        let of = |n: u32| percentile_90((1..=n).rev().map(f64::from).collect());
        assert_eq!(
            (of(0), of(1), of(10), of(11), of(100)),
            (None, Some(1.0), Some(9.0), Some(10.0), Some(90.0))
        );
    }

    #[test]
    fn means_are_taken_over_the_views_that_have_the_metric() {
        let with = ViewErrors::of(&drawn(), &view(Some(vec![2.0, 1.0])));
        let without = ViewErrors::of(&drawn(), &view(None));
        let mean = ViewErrors::mean(&[with, without]).unwrap();
        assert_eq!((mean.depth_mae_m, mean.silhouette_iou), (Some(0.5), 1.0));
        assert_eq!(ViewErrors::mean(&[]), None);
    }
}
