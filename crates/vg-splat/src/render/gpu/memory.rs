//! Working memory on the device, kept from picture to picture and grown as needed.

use super::device::Device;
use super::frame::Frame;
use bytemuck::Zeroable;

/// Entries of a block of `shaders/scan.wgsl`.
const SCAN_BLOCK: u64 = 2048;
/// Entries of a block of `shaders/sort.wgsl`.
const SORT_BLOCK: u64 = 1024;
/// Bits of the key per pass of `shaders/sort.wgsl`.
pub(super) const DIGIT_BITS: u32 = 4;

/// A buffer of `bytes` that kernels read and write.
pub(super) fn storage(device: &Device, label: &str, bytes: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        // A binding must not be empty.
        size: bytes.max(16).next_multiple_of(4),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A buffer of constants of a kernel.
pub(super) fn uniform(device: &Device, label: &str, data: &[u8]) -> wgpu::Buffer {
    let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: data.len() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    device.queue.write_buffer(&buffer, 0, data);
    buffer
}

/// A buffer that the CPU reads.
fn readable(device: &Device, label: &str, bytes: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn words(device: &Device, label: &str, count: u64) -> wgpu::Buffer {
    storage(device, label, 4 * count)
}

/// 32-bit numbers for a prefix sum, with buffers for the totals of each level.
#[derive(Debug)]
pub(super) struct Sums {
    pub(super) values: wgpu::Buffer,
    /// Totals of the blocks of 2048, totals of blocks of those, and so on; the last holds one number, the overall
    /// total.
    pub(super) levels: Vec<wgpu::Buffer>,
}

impl Sums {
    fn new(device: &Device, label: &str, count: u64) -> Self {
        let values = words(device, label, count);
        let mut levels = Vec::new();
        let mut left = values.size() / 4;
        loop {
            left = left.div_ceil(SCAN_BLOCK);
            // Exactly one word per block: kernels use the length of their bindings.
            levels.push(device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("totals"),
                size: 4 * left,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }));
            if left == 1 {
                return Self { values, levels };
            }
        }
    }

    /// The buffer with the overall total.
    pub(super) fn total(&self) -> &wgpu::Buffer {
        // There is at least one level.
        &self.levels[self.levels.len() - 1]
    }

    fn bytes(&self) -> u64 {
        self.values.size() + self.levels.iter().map(wgpu::Buffer::size).sum::<u64>()
    }
}

/// Two buffers of keys and values: a pass sorts from one to the other.
#[derive(Debug)]
pub(super) struct Entries {
    pub(super) keys: [wgpu::Buffer; 2],
    pub(super) values: [wgpu::Buffer; 2],
    /// `[16][blocks]`
    pub(super) histogram: Sums,
    /// `Pass` of `shaders/sort.wgsl` for each digit.
    pub(super) passes: Vec<wgpu::Buffer>,
    pub(super) capacity: u64,
}

impl Entries {
    fn new(device: &Device, label: &str, capacity: u64) -> Self {
        let buffer = || words(device, label, capacity);
        let blocks = capacity.div_ceil(SORT_BLOCK);
        let pass = |i: u32| {
            let pass = [DIGIT_BITS * i, u32::from(i == 0), blocks as u32, 0];
            uniform(device, "pass", bytemuck::cast_slice(&pass))
        };
        Self {
            keys: [buffer(), buffer()],
            values: [buffer(), buffer()],
            histogram: Sums::new(device, "histogram", 16 * blocks),
            passes: (0..u32::BITS / DIGIT_BITS).map(pass).collect(),
            capacity,
        }
    }

    fn bytes(&self) -> u64 {
        4 * self.keys[0].size() + self.histogram.bytes()
    }
}

/// Buffers for as many Gaussians as `depths` has capacity for.
#[derive(Debug)]
pub(super) struct PerGaussian {
    pub(super) splats: wgpu::Buffer,
    pub(super) tints: wgpu::Buffer,
    /// Sort by depth; the values are the splats' indices.
    pub(super) depths: Entries,
    /// Number of pairs before each depth rank; one more entry than there are splats.
    pub(super) offsets: Sums,
}

/// Buffers for as many (tile, splat) pairs as `tiles` has capacity for.
#[derive(Debug)]
pub(super) struct PerPair {
    /// Sort by tile; the values are the pairs' indices.
    pub(super) tiles: Entries,
    /// Splat of each pair.
    pub(super) splat_from_pair: wgpu::Buffer,
}

/// Buffers for the tiles and pixels of a band.
#[derive(Debug)]
pub(super) struct PerBand {
    pub(super) ranges: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
}

/// Buffers from which the CPU reads the result of a slice.
#[derive(Debug)]
pub(super) struct Readback {
    /// The number of pairs, the slice's end, and whether a pixel is unfinished.
    pub(super) numbers: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
}

impl Readback {
    fn bytes(&self) -> u64 {
        self.numbers.size() + self.picture.size()
    }
}

/// Buffers of the backward pass.
#[derive(Debug)]
pub(super) struct Back {
    /// Gradient of a band's pixels.
    pub(super) gradient: wgpu::Buffer,
    /// Gradient of the background, from each tile of a window.
    pub(super) backgrounds: wgpu::Buffer,
    pub(super) backgrounds_readback: wgpu::Buffer,
    /// Each pair's contribution to its splat's sums.
    pub(super) shares: wgpu::Buffer,
    pub(super) sums: Vec<SplatSums>,
}

/// Sums of consecutive Gaussians.
#[derive(Debug)]
pub(super) struct SplatSums {
    pub(super) count: usize,
    /// Index of the first Gaussian, and the count.
    pub(super) range: wgpu::Buffer,
    pub(super) sums: wgpu::Buffer,
    pub(super) readback: wgpu::Buffer,
}

impl Back {
    fn bytes(&self) -> u64 {
        let sums: u64 = self.sums.iter().map(|s| s.sums.size() + s.readback.size()).sum();
        self.gradient.size() + 2 * self.backgrounds.size() + self.shares.size() + sums
    }
}

impl SplatSums {
    fn new(device: &Device, first: usize, count: usize) -> Self {
        let bytes = SUMS * count as u64 + 4;
        Self {
            count,
            range: uniform(device, "sums' range", bytemuck::cast_slice(&[first as u32, count as u32, 0, 0])),
            sums: storage(device, "sums", bytes),
            readback: readable(device, "sums to read", bytes),
        }
    }
}

/// Buffers of a single value.
#[derive(Debug)]
pub(super) struct Counters {
    pub(super) frame: wgpu::Buffer,
    /// The number of Gaussians.
    pub(super) gaussians: wgpu::Buffer,
    /// Rank of the splat whose pairs did not fit, or `u32::MAX`.
    pub(super) slice_end: wgpu::Buffer,
    /// Whether a pixel is unfinished.
    pub(super) unfinished: wgpu::Buffer,
}

/// Bytes of `Readback::numbers`.
pub(super) const NUMBERS: u64 = 12;
/// Bytes of a pixel: colour, alpha, depth.
pub(super) const PIXEL: u64 = 20;
/// Bytes of a splat.
pub(super) const SPLAT: u64 = 32;
/// Bytes of a pair's contribution to its splat: `shares` of `shaders/back.wgsl`.
pub(super) const SHARE: u64 = 40;
/// Bytes of a splat's sums: `sums` of `shaders/gather.wgsl`.
pub(super) const SUMS: u64 = 44;
/// Bytes of a tile's gradient of the background.
pub(super) const BACKGROUND: u64 = 16;

/// The source of splats or lists: the asset's id, and the parameters on which they depend.
pub(super) type Source = (u64, Frame);

/// All working memory. Submissions are executed in order, so they share one set of buffers, except for those that the
/// CPU reads, possibly after the next submission.
#[derive(Debug)]
pub(super) struct Memory {
    pub(super) counters: Counters,
    pub(super) gaussian: Option<PerGaussian>,
    pub(super) pair: Option<PerPair>,
    pub(super) band: Option<PerBand>,
    pub(super) back: Option<Back>,
    /// Readbacks not in use.
    readbacks: Vec<Readback>,
    /// The asset whose last picture did not fit in one slice.
    pub(super) sliced_asset: Option<u64>,
    /// The number of submissions that made lists of pairs.
    pub(super) listings: u64,
    /// Source of the splats and their order, if they are valid.
    pub(super) splats_source: Option<Source>,
    /// Source of the pairs, if all those of a window are listed, and their number.
    pub(super) pairs_source: Option<(Source, u32)>,
}

impl Memory {
    pub(super) fn new(device: &Device) -> Self {
        let counters = Counters {
            frame: uniform(device, "frame", bytemuck::bytes_of(&Frame::zeroed())),
            gaussians: words(device, "gaussians", 1),
            slice_end: words(device, "slice end", 1),
            unfinished: words(device, "unfinished", 1),
        };
        Self {
            counters,
            gaussian: None,
            pair: None,
            band: None,
            back: None,
            readbacks: Vec::new(),
            sliced_asset: None,
            listings: 0,
            splats_source: None,
            pairs_source: None,
        }
    }

    /// Takes buffers for the CPU to read the numbers and this many bytes of a picture. The caller returns them after
    /// reading.
    pub(super) fn readback(&mut self, device: &Device, bytes: u64) -> Readback {
        if let Some(i) = self.readbacks.iter().position(|r| r.picture.size() >= bytes) {
            return self.readbacks.swap_remove(i);
        }
        // Frees one that is too small first.
        self.readbacks.pop();
        Readback {
            numbers: readable(device, "numbers to read", NUMBERS),
            picture: readable(device, "picture to read", bytes.max(4)),
        }
    }

    /// Returns the buffers that [`Memory::readback`] lent.
    pub(super) fn return_readback(&mut self, readback: Readback) {
        self.readbacks.push(readback);
    }

    /// Reserves memory for at least `count` Gaussians.
    pub(super) fn reserve_gaussians(&mut self, device: &Device, count: u64) {
        if self.gaussian.as_ref().is_some_and(|g| g.depths.capacity >= count) {
            return;
        }
        // The old buffers are freed first.
        self.gaussian = None;
        (self.splats_source, self.pairs_source) = (None, None);
        self.gaussian = Some(PerGaussian {
            splats: storage(device, "splats", SPLAT * count),
            tints: storage(device, "tints", 16 * count),
            depths: Entries::new(device, "depths", count),
            offsets: Sums::new(device, "offsets", count + 1),
        });
    }

    /// Reserves memory for at least `count` pairs.
    pub(super) fn reserve_pairs(&mut self, device: &Device, count: u64) {
        if self.pair.as_ref().is_some_and(|p| p.tiles.capacity >= count) {
            return;
        }
        self.pair = None;
        self.pairs_source = None;
        self.pair = Some(PerPair {
            tiles: Entries::new(device, "tiles", count),
            splat_from_pair: words(device, "pair splats", count),
        });
    }

    /// Reserves memory for a band of at least these sizes.
    pub(super) fn reserve_band(&mut self, device: &Device, tiles: u64, pixels: u64) {
        let fits = |b: &PerBand| b.ranges.size() >= 8 * tiles && b.picture.size() >= PIXEL * pixels;
        if self.band.as_ref().is_some_and(fits) {
            return;
        }
        self.band = None;
        self.pairs_source = None;
        let picture = storage(device, "picture", PIXEL * pixels);
        self.band = Some(PerBand { ranges: storage(device, "ranges", 8 * tiles), picture });
    }

    /// Reserves memory for the backward pass of `count` Gaussians and at least this many tiles and pixels of a band.
    pub(super) fn reserve_backward(
        &mut self,
        device: &Device,
        count: usize,
        [tiles, pixels]: [u64; 2],
        largest_binding: u64,
    ) {
        let fits = |b: &Back| {
            b.gradient.size() >= PIXEL * pixels
                && b.backgrounds.size() >= BACKGROUND * tiles
                && b.sums.iter().map(|s| s.count).sum::<usize>() == count
        };
        if self.back.as_ref().is_some_and(fits) {
            return;
        }
        self.back = None;
        let backgrounds = storage(device, "backgrounds", BACKGROUND * tiles);
        let backgrounds_readback = readable(device, "backgrounds to read", backgrounds.size());
        let each = ((largest_binding.saturating_sub(4) / SUMS) as usize).max(1);
        let sums = (0..count).step_by(each).map(|i| SplatSums::new(device, i, each.min(count - i))).collect();
        self.back = Some(Back {
            gradient: storage(device, "gradient", PIXEL * pixels),
            backgrounds,
            backgrounds_readback,
            shares: storage(device, "shares", SHARE),
            sums,
        });
    }

    /// Reserves memory for the shares of `pairs` pairs, or of as many as fit in a binding, after
    /// [`Memory::reserve_backward`].
    pub(super) fn reserve_shares(&mut self, device: &Device, pairs: u64, largest_binding: u64) {
        let Some(back) = &mut self.back else { return };
        let bytes = SHARE * pairs.min(largest_binding / SHARE).max(1);
        if back.shares.size() < bytes {
            // The old buffer is freed first.
            back.shares.destroy();
            back.shares = storage(device, "shares", bytes);
        }
    }

    /// Memory on the device, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let gaussian = self
            .gaussian
            .as_ref()
            .map_or(0, |g| g.splats.size() + g.tints.size() + g.depths.bytes() + g.offsets.bytes());
        let pair = self.pair.as_ref().map_or(0, |p| p.tiles.bytes() + p.splat_from_pair.size());
        let band = self.band.as_ref().map_or(0, |b| b.ranges.size() + b.picture.size());
        let back = self.back.as_ref().map_or(0, Back::bytes);
        let readbacks: u64 = self.readbacks.iter().map(Readback::bytes).sum();
        gaussian + pair + band + back + readbacks
    }
}
