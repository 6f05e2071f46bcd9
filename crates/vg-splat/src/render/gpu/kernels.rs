//! The kernels of the stages, compiled once per device.

use super::device::Device;

/// Compute pipelines; the shaders are in `shaders`.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) project: wgpu::ComputePipeline,
    pub(super) scan: wgpu::ComputePipeline,
    pub(super) scan_add: wgpu::ComputePipeline,
    pub(super) sort_count: wgpu::ComputePipeline,
    pub(super) sort_scatter: wgpu::ComputePipeline,
    pub(super) cover: wgpu::ComputePipeline,
    pub(super) emit: wgpu::ComputePipeline,
    pub(super) find_ranges: wgpu::ComputePipeline,
    pub(super) blend: wgpu::ComputePipeline,
    pub(super) back: wgpu::ComputePipeline,
    pub(super) gather: wgpu::ComputePipeline,
}

/// Common part of all shaders.
const FRAME: &str = include_str!("shaders/frame.wgsl");
/// Common part of forward and backward blending.
const LAYERS: &str = include_str!("shaders/layers.wgsl");

impl Kernels {
    pub(super) fn new(device: &Device) -> Self {
        let module = |name: &str, source: &str| {
            let source = wgpu::ShaderSource::Wgsl(format!("{FRAME}\n{source}").into());
            device.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source })
        };
        let pipeline = |module: &wgpu::ShaderModule, entry_point: &str| {
            device.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                // Deduced, so that a stage's bindings are declared only in its shader.
                layout: None,
                module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions {
                    // Each kernel writes its workgroup memory before it reads it.
                    zero_initialize_workgroup_memory: false,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            })
        };
        let blending = |name: &str, source: &str| module(name, &format!("{LAYERS}\n{source}"));
        let scan = module("scan", include_str!("shaders/scan.wgsl"));
        let sort = module("sort", include_str!("shaders/sort.wgsl"));
        let tiles = module("tiles", include_str!("shaders/tiles.wgsl"));
        Self {
            project: pipeline(&module("project", include_str!("shaders/project.wgsl")), "project"),
            scan: pipeline(&scan, "scan"),
            scan_add: pipeline(&scan, "add"),
            sort_count: pipeline(&sort, "count"),
            sort_scatter: pipeline(&sort, "scatter"),
            cover: pipeline(&tiles, "cover"),
            emit: pipeline(&tiles, "emit"),
            find_ranges: pipeline(&module("ranges", include_str!("shaders/ranges.wgsl")), "find"),
            blend: pipeline(&blending("blend", include_str!("shaders/blend.wgsl")), "blend"),
            back: pipeline(&blending("back", include_str!("shaders/back.wgsl")), "back"),
            gather: pipeline(&module("gather", include_str!("shaders/gather.wgsl")), "gather"),
        }
    }
}
