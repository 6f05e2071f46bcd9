//! Gaussians on the graphics processor: uploaded once, drawn many times.

use super::MOST_GROUPS;
use super::device::Device;
use super::memory::{storage, uniform};
use crate::gaussians::{Gaussians, sh};
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};
use vg_geometry::{Camera, Result};

/// Number of floats of a Gaussian without its colour: mean, quaternion, standard deviations, opacity.
const SHAPE: usize = 11;

/// Gaussians in the memory of a [`GpuRenderer`](super::GpuRenderer)'s device.
#[derive(Debug)]
pub struct GpuAsset {
    /// Unique in this process.
    pub(super) id: u64,
    pub(super) count: usize,
    pub(super) sh_degree: u8,
    pub(super) chunks: Vec<Chunk>,
    /// Bounds of the means, metres; from infinity to -infinity where there are none.
    low: DVec3,
    high: DVec3,
}

/// Consecutive Gaussians, as many as fit in one binding.
#[derive(Debug)]
pub(super) struct Chunk {
    pub(super) count: usize,
    /// Index of the first Gaussian, and the count.
    pub(super) range: wgpu::Buffer,
    pub(super) shapes: wgpu::Buffer,
    pub(super) colors: wgpu::Buffer,
}

impl GpuAsset {
    pub(super) fn upload(device: &Device, gaussians: &Gaussians, largest_binding: u64) -> Result<Self> {
        let stride = gaussians.sh_stride();
        let most = ((largest_binding / 4) as usize / stride.max(SHAPE)).min(64 * MOST_GROUPS as usize);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for mean in gaussians.means() {
            let mean = DVec3::from_array(mean.map(f64::from));
            (low, high) = (low.min(mean), high.max(mean));
        }
        let mut chunks = Vec::new();
        let mut shapes = Vec::new();
        for first in (0..gaussians.len()).step_by(most) {
            let count = most.min(gaussians.len() - first);
            shapes.clear();
            for i in first..first + count {
                shapes.extend_from_slice(&gaussians.means()[i]);
                shapes.extend_from_slice(&gaussians.rotations()[i]);
                shapes.extend_from_slice(&gaussians.scales()[i]);
                shapes.push(gaussians.opacities()[i]);
            }
            let colors = &gaussians.sh()[first * stride..(first + count) * stride];
            let buffer = |label, data: &[u8]| {
                let buffer = storage(device, label, data.len() as u64);
                device.queue.write_buffer(&buffer, 0, data);
                buffer
            };
            let range = [first as u32, count as u32, 0, 0];
            chunks.push(Chunk {
                count,
                range: uniform(device, "chunk", bytemuck::cast_slice(&range)),
                shapes: buffer("shapes", bytemuck::cast_slice(&shapes)),
                colors: buffer("colors", bytemuck::cast_slice(colors)),
            });
            // Frees the staging memory before the next chunk.
            device.queue.submit([]);
            let _ = device.device.poll(wgpu::PollType::wait_indefinitely());
            device.check()?;
        }
        static MADE: AtomicU64 = AtomicU64::new(0);
        let id = MADE.fetch_add(1, Ordering::Relaxed);
        Ok(Self { id, count: gaussians.len(), sh_degree: gaussians.sh_degree(), chunks, low, high })
    }

    /// The number of Gaussians.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// SH degree of the colours, 0 to 3.
    pub fn sh_degree(&self) -> u8 {
        self.sh_degree
    }

    /// Memory on the device, bytes.
    pub fn bytes(&self) -> u64 {
        self.chunks.iter().map(|c| c.shapes.size() + c.colors.size()).sum()
    }

    /// Bounds of the depths that can occur between `near` and `far`, metres, which leave fewer bits to sort by.
    pub(super) fn depths(&self, camera: &Camera, [near, far]: [f32; 2]) -> [f32; 2] {
        let axis = camera.vehicle_from_camera.rotation.z_axis;
        let center = camera.center();
        // The corner farthest along the axis, and the nearest.
        let farthest = DVec3::select(axis.cmpge(DVec3::ZERO), self.high, self.low) - center;
        let nearest = DVec3::select(axis.cmpge(DVec3::ZERO), self.low, self.high) - center;
        // Tolerance for the kernel's double-float arithmetic and the rounding to f32.
        let reach = farthest.abs().max(nearest.abs()).max_element();
        let bound = |depth: f64, sign: f64| (depth + sign * (1e-6 * depth.abs() + 1e-9 * reach)) as f32;
        let (first, last) = (bound(axis.dot(nearest), -1.0), bound(axis.dot(farthest), 1.0));
        // The NaN from an empty asset's bounds is replaced by `near` or `far`.
        let first = first.max(near).min(far);
        [first, last.min(far).max(first)]
    }
}

/// The number of coefficients per channel that are used.
pub(super) fn coefficients(asset: &GpuAsset, sh_degree: u8) -> usize {
    sh::coefficients(sh_degree.min(asset.sh_degree))
}
