//! The kernels' parameters: `Frame` of `shaders/frame.wgsl`.

use super::asset::{GpuAsset, coefficients};
use crate::gaussians::sh;
use crate::render::view::PinholeView;
use crate::render::{Background, DepthMode, RenderOptions};
use vg_geometry::Camera;

/// Equal to `Frame` in the shaders, field by field.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Frame {
    rotation: [[f32; 4]; 3],
    rotation_rest: [[f32; 4]; 3],
    center: [f32; 4],
    center_rest: [f32; 4],
    focal: [f32; 4],
    principal: [f32; 4],
    jacobian_range: [f32; 4],
    background: [f32; 4],
    pub(super) width: u32,
    pub(super) height: u32,
    near: f32,
    far: f32,
    blur: f32,
    max_alpha: f32,
    pub(super) count: u32,
    sh_stride: u32,
    sh_coefficients: u32,
    antialiased: u32,
    expected_depth: u32,
    opaque_zero: u32,
    pub(super) tile_columns: u32,
    pub(super) first_tile_row: u32,
    pub(super) tile_rows: u32,
    pub(super) slice_start: u32,
    pub(super) slice_splats: u32,
    pub(super) pair_capacity: u32,
    pub(super) is_first: u32,
    pub(super) is_last: u32,
    first_key: u32,
    pub(super) first_tile_column: u32,
    pub(super) band_row: u32,
    pub(super) first_pair: u32,
    pub(super) held_pairs: u32,
    /// Padding: a structure's size is a multiple of its largest vector's.
    spare: [u32; 3],
}

/// Pixels along a tile's side, equal to `TILE` in the shaders.
pub(super) const TILE: u32 = 8;

impl Frame {
    /// Parameters with the whole picture as one band and one slice. `depths` are the bounds of those that can occur.
    pub(super) fn new(asset: &GpuAsset, camera: &Camera, options: &RenderOptions, depths: [f32; 2]) -> Self {
        let view = PinholeView::new(camera, options, asset.sh_degree);
        let i = view.intrinsics;
        let rows = |part: fn(f64) -> f32| view.rotation.map(|row| triple(row.map(part)));
        let [x, y] = view.jacobian_range;
        let background = match options.background {
            Background::Color([r, g, b]) => [r, g, b, 1.0],
            Background::Transparent => [0.0; 4],
        };
        Self {
            rotation: rows(|v| v as f32),
            rotation_rest: rows(rest),
            center: triple(view.center.map(|v| v as f32)),
            center_rest: triple(view.center.map(rest)),
            focal: [i.fx as f32, rest(i.fx), i.fy as f32, rest(i.fy)],
            principal: [i.cx as f32, rest(i.cx), i.cy as f32, rest(i.cy)],
            jacobian_range: [x[0] as f32, x[1] as f32, y[0] as f32, y[1] as f32],
            background,
            width: camera.width,
            height: camera.height,
            near: options.near,
            far: options.far,
            blur: options.blur,
            max_alpha: options.max_alpha,
            count: asset.count as u32,
            sh_stride: 3 * sh::coefficients(asset.sh_degree) as u32,
            sh_coefficients: coefficients(asset, options.sh_degree) as u32,
            antialiased: u32::from(options.antialiased),
            expected_depth: u32::from(options.depth_mode == DepthMode::Expected),
            opaque_zero: 0,
            tile_columns: camera.width.div_ceil(TILE),
            first_tile_row: 0,
            tile_rows: camera.height.div_ceil(TILE),
            slice_start: 0,
            slice_splats: u32::MAX,
            pair_capacity: 0,
            is_first: 1,
            is_last: 1,
            first_key: depths[0].to_bits(),
            first_tile_column: 0,
            band_row: 0,
            first_pair: 0,
            held_pairs: 0,
            spare: [0; 3],
        }
    }

    /// The parameters on which the lists of pairs of a whole window depend.
    pub(super) fn list_parameters(&self) -> Self {
        Self {
            slice_start: 0,
            slice_splats: u32::MAX,
            pair_capacity: 0,
            is_first: 1,
            is_last: 1,
            band_row: 0,
            first_pair: 0,
            held_pairs: 0,
            ..*self
        }
    }

    /// The parameters on which the splats and their order depend.
    pub(super) fn splat_parameters(&self) -> Self {
        Self {
            tile_columns: 0,
            first_tile_column: 0,
            first_tile_row: 0,
            tile_rows: 0,
            ..self.list_parameters()
        }
    }
}

/// The rounding error of a number in f32.
fn rest(v: f64) -> f32 {
    (v - f64::from(v as f32)) as f32
}

fn triple([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}
