//! The stages of a picture, recorded as commands for the device.

use super::MOST_GROUPS;
use super::asset::GpuAsset;
use super::device::Device;
use super::frame::Frame;
use super::kernels::Kernels;
use super::memory::{
    BACKGROUND, Back, Counters, DIGIT_BITS, Entries, PerBand, PerGaussian, PerPair, Readback, SUMS, Sums,
};

/// A recorder of commands for the device.
pub(super) struct Stages<'a> {
    device: &'a Device,
    kernels: &'a Kernels,
    encoder: wgpu::CommandEncoder,
    /// The open compute pass; copies end it.
    pass: Option<wgpu::ComputePass<'static>>,
}

/// The number of a binding in the shader, and its buffer.
type Binding<'b> = (u32, &'b wgpu::Buffer);

/// Equal to `PART` in `shaders/tiles.wgsl`.
const PART: u64 = 32768;

/// Number of bits in which numbers below `count` differ.
pub(super) fn significant_bits(count: u32) -> u32 {
    u32::BITS - count.saturating_sub(1).leading_zeros()
}

/// Number of passes that sort this many bits: at least one, which drops splats that are not drawn.
fn passes(bits: u32) -> usize {
    bits.div_ceil(DIGIT_BITS).max(1) as usize
}

/// The buffer of sorted values: each pass goes from one buffer to the other.
fn sorted(entries: &Entries, bits: u32) -> &wgpu::Buffer {
    &entries.values[passes(bits) % 2]
}

impl<'a> Stages<'a> {
    pub(super) fn new(device: &'a Device, kernels: &'a Kernels) -> Self {
        let encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        Self { device, kernels, encoder, pass: None }
    }

    /// Projects the Gaussians to splats, with the difference of their depth's bits from the smallest as keys.
    pub(super) fn project(&mut self, asset: &GpuAsset, counters: &Counters, per: &PerGaussian) {
        for chunk in &asset.chunks {
            let bindings = [
                (0, &counters.frame),
                (1, &chunk.range),
                (2, &chunk.shapes),
                (3, &chunk.colors),
                (4, &per.splats),
                (5, &per.tints),
                (6, &per.depths.keys[0]),
            ];
            self.run(&self.kernels.project, &bindings, [chunk.count.div_ceil(64) as u32, 1]);
        }
    }

    /// Sorts the indices of the drawn splats by depth, in which `bits` bits differ.
    pub(super) fn sort_by_depth(&mut self, counters: &Counters, per: &PerGaussian, bits: u32) {
        self.sort(&per.depths, &counters.gaussians, bits);
    }

    /// Lists the (tile, splat) pairs of the band in depth order, from the slice's first splat on, as many as fit.
    pub(super) fn list_pairs(
        &mut self,
        counters: &Counters,
        per: &PerGaussian,
        pair: &PerPair,
        depth_bits: u32,
        tiles: u64,
    ) {
        let splat_from_rank = sorted(&per.depths, depth_bits);
        let drawn = per.depths.histogram.total();
        let bindings = [
            (0, &counters.frame),
            (1, drawn),
            (2, splat_from_rank),
            (3, &per.splats),
            (4, &per.offsets.values),
            (5, &pair.tiles.keys[0]),
            (6, &pair.splat_from_pair),
            (7, &counters.slice_end),
        ];
        let ranks = per.offsets.values.size() / 4;
        let groups = ranks.div_ceil(256) as u32;
        self.run(&self.kernels.cover, &bindings[..5], [groups, 1]);
        self.sum(&per.offsets);
        // A splat has at most one pair per tile.
        self.run(&self.kernels.emit, &bindings, [groups, tiles.div_ceil(PART) as u32]);
    }

    /// Sorts the pairs by tile, nearest first, and finds the range of each tile.
    pub(super) fn sort_by_tile(&mut self, per: &PerGaussian, pair: &PerPair, band: &PerBand, bits: u32) {
        self.sort(&pair.tiles, per.offsets.total(), bits);
        self.close();
        self.encoder.clear_buffer(&band.ranges, 0, None);
        let tiles = &pair.tiles.keys[passes(bits) % 2];
        let bindings = [(0, pair.tiles.histogram.total()), (1, tiles), (2, &band.ranges)];
        let groups = pair.tiles.capacity.div_ceil(256).min(MOST_GROUPS) as u32;
        self.run(&self.kernels.find_ranges, &bindings, [groups, 1]);
    }

    /// Blends the band's tiles.
    pub(super) fn blend(
        &mut self,
        frame: &Frame,
        counters: &Counters,
        per: &PerGaussian,
        pair: &PerPair,
        band: &PerBand,
        tile_bits: u32,
    ) {
        let bindings = [
            (0, &counters.frame),
            (1, &band.ranges),
            (2, sorted(&pair.tiles, tile_bits)),
            (3, &pair.splat_from_pair),
            (4, &per.splats),
            (5, &per.tints),
            (6, &band.picture),
            (7, &counters.unfinished),
        ];
        self.run(&self.kernels.blend, &bindings, [frame.tile_columns, frame.tile_rows]);
    }

    /// Differentiates the window's tiles, for the pairs that are held, and adds their shares to each splat's sums.
    pub(super) fn back(
        &mut self,
        frame: &Frame,
        counters: &Counters,
        (per, pair): (&PerGaussian, &PerPair),
        band: &PerBand,
        back: &Back,
        [depth_bits, tile_bits]: [u32; 2],
    ) {
        let bindings = [
            (0, &counters.frame),
            (1, &band.ranges),
            (2, sorted(&pair.tiles, tile_bits)),
            (3, &pair.splat_from_pair),
            (4, &per.splats),
            (5, &per.tints),
            (6, &back.gradient),
            (7, &back.shares),
            (8, &back.backgrounds),
        ];
        self.run(&self.kernels.back, &bindings, [frame.tile_columns, frame.tile_rows]);
        for chunk in &back.sums {
            let bindings = [
                (0, &counters.frame),
                (1, &chunk.range),
                (2, per.depths.histogram.total()),
                (3, sorted(&per.depths, depth_bits)),
                (4, &per.offsets.values),
                (5, &back.shares),
                (6, &per.splats),
                (7, &per.tints),
                (8, &chunk.sums),
            ];
            let threads = 11 * per.depths.capacity;
            self.run(&self.kernels.gather, &bindings, [threads.div_ceil(256).min(MOST_GROUPS) as u32, 1]);
        }
    }

    /// Copies the background's gradients of the window's tiles to where the CPU can read them.
    pub(super) fn read_backgrounds(&mut self, back: &Back, tiles: u64) {
        self.close();
        let to = &back.backgrounds_readback;
        self.encoder.copy_buffer_to_buffer(&back.backgrounds, 0, to, 0, BACKGROUND * tiles);
    }

    /// Sets the sums to zero.
    pub(super) fn clear_sums(&mut self, back: &Back) {
        self.close();
        for chunk in &back.sums {
            self.encoder.clear_buffer(&chunk.sums, 0, None);
        }
    }

    /// Copies the sums to where the CPU can read them.
    pub(super) fn read_sums(&mut self, back: &Back) {
        self.close();
        for chunk in &back.sums {
            let bytes = SUMS * chunk.count as u64 + 4;
            self.encoder.copy_buffer_to_buffer(&chunk.sums, 0, &chunk.readback, 0, bytes);
        }
    }

    /// Copies the result of the slice and, of a last slice, this `part` (offset, bytes) of the band's picture to where
    /// the CPU can read them.
    pub(super) fn read_back(
        &mut self,
        counters: &Counters,
        per: &PerGaussian,
        band: &PerBand,
        to: &Readback,
        part: Option<[u64; 2]>,
    ) {
        self.close();
        let numbers = [per.offsets.total(), &counters.slice_end, &counters.unfinished];
        for (i, from) in numbers.into_iter().enumerate() {
            self.encoder.copy_buffer_to_buffer(from, 0, &to.numbers, 4 * i as u64, 4);
        }
        if let Some([from, bytes]) = part {
            self.encoder.copy_buffer_to_buffer(&band.picture, from, &to.picture, 0, bytes);
        }
    }

    /// Submits the commands to the device.
    pub(super) fn submit(mut self) -> wgpu::SubmissionIndex {
        self.close();
        self.device.queue.submit([self.encoder.finish()])
    }

    /// Sorts `entries` by the lowest `bits` of their keys, stably; the first pass drops those that are not drawn.
    fn sort(&mut self, entries: &Entries, count: &wgpu::Buffer, bits: u32) {
        let groups = [entries.histogram.values.size() as u32 / 64, 1];
        let remaining = entries.histogram.total();
        for i in 0..passes(bits) {
            let (from, to) = (i % 2, (i + 1) % 2);
            let bindings = [
                (0, &entries.passes[i]),
                (1, if i == 0 { count } else { remaining }),
                (2, &entries.keys[from]),
                (3, &entries.histogram.values),
                (4, &entries.values[from]),
                (5, &entries.keys[to]),
                (6, &entries.values[to]),
            ];
            self.run(&self.kernels.sort_count, &bindings[..4], groups);
            self.sum(&entries.histogram);
            self.run(&self.kernels.sort_scatter, &bindings, groups);
        }
    }

    /// Replaces each value by the sum of those before it.
    fn sum(&mut self, sums: &Sums) {
        let levels: Vec<&wgpu::Buffer> = std::iter::once(&sums.values).chain(&sums.levels).collect();
        let blocks = |level: usize| [(levels[level + 1].size() / 4) as u32, 1];
        for level in 0..levels.len() - 1 {
            self.run(&self.kernels.scan, &[(0, levels[level]), (1, levels[level + 1])], blocks(level));
        }
        for level in (0..levels.len() - 2).rev() {
            self.run(&self.kernels.scan_add, &[(0, levels[level]), (1, levels[level + 1])], blocks(level));
        }
    }

    fn run(&mut self, kernel: &wgpu::ComputePipeline, bindings: &[Binding], groups: [u32; 2]) {
        let entries: Vec<wgpu::BindGroupEntry> = bindings
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &kernel.get_bind_group_layout(0),
            entries: &entries,
        });
        let pass = self.pass.get_or_insert_with(|| {
            self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()).forget_lifetime()
        });
        pass.set_pipeline(kernel);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }

    fn close(&mut self) {
        self.pass = None;
    }
}
