//! Working memory on the device, kept from picture to picture and grown when one needs more.

use super::device::Device;
use super::frame::Frame;
use bytemuck::Zeroable;

/// Entries of a block of `shaders/scan.wgsl`.
const SCAN_BLOCK: u64 = 2048;
/// Entries of a block of `shaders/sort.wgsl`.
const SORT_BLOCK: u64 = 1024;
/// Bits of a key that one pass of it sorts by.
pub(super) const DIGIT_BITS: u32 = 4;

/// A buffer of `bytes` that kernels read and write.
pub(super) fn storage(device: &Device, label: &str, bytes: u64) -> wgpu::Buffer {
    device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        // A binding may not be empty.
        size: bytes.max(16).next_multiple_of(4),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// A buffer of numbers that do not change while a kernel runs.
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

/// A buffer that the processor reads.
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

/// Numbers of 32 bits that are to be summed up, with room for the totals of each level.
#[derive(Debug)]
pub(super) struct Sums {
    pub(super) values: wgpu::Buffer,
    /// Of the blocks of 2048, of the blocks of those, and so on; the last holds one number, the total of all.
    pub(super) levels: Vec<wgpu::Buffer>,
}

impl Sums {
    fn new(device: &Device, label: &str, count: u64) -> Self {
        let values = words(device, label, count);
        let mut levels = Vec::new();
        let mut left = values.size() / 4;
        loop {
            left = left.div_ceil(SCAN_BLOCK);
            // Exactly as many words as there are blocks: kernels go by the length of what they are given.
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

    /// Where the total of all is.
    pub(super) fn total(&self) -> &wgpu::Buffer {
        // There is one level at least.
        &self.levels[self.levels.len() - 1]
    }

    fn bytes(&self) -> u64 {
        self.values.size() + self.levels.iter().map(wgpu::Buffer::size).sum::<u64>()
    }
}

/// Keys with values, twice: a pass sorts from one to the other.
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

/// What as many Gaussians as `depths` has room for need.
#[derive(Debug)]
pub(super) struct PerGaussian {
    pub(super) splats: wgpu::Buffer,
    pub(super) tints: wgpu::Buffer,
    /// By depth; the values are the splats' numbers.
    pub(super) depths: Entries,
    /// By rank in depth: pairs before it. One more than there are splats.
    pub(super) offsets: Sums,
}

/// What as many (tile, splat) pairs as `tiles` has room for need.
#[derive(Debug)]
pub(super) struct PerPair {
    /// By tile; the values are the pairs' numbers.
    pub(super) tiles: Entries,
    /// Splat of each pair, by number.
    pub(super) splats: wgpu::Buffer,
}

/// What a band of so many tiles and pixels needs.
#[derive(Debug)]
pub(super) struct PerBand {
    pub(super) ranges: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
    /// Of `picture`, where the processor can read it.
    pub(super) readback: wgpu::Buffer,
}

/// Numbers of which there is one.
#[derive(Debug)]
pub(super) struct Counters {
    pub(super) frame: wgpu::Buffer,
    /// How many Gaussians there are.
    pub(super) gaussians: wgpu::Buffer,
    /// Rank of the splat whose pairs did not fit, or `u32::MAX`.
    pub(super) slice_end: wgpu::Buffer,
    /// Whether a pixel is not finished.
    pub(super) unfinished: wgpu::Buffer,
    /// How many pairs there were, the slice's end, and whether a pixel is not finished, for the processor.
    pub(super) readback: wgpu::Buffer,
}

/// Bytes of a pixel: colour, alpha, depth.
pub(super) const PIXEL: u64 = 20;
/// Bytes of a splat.
pub(super) const SPLAT: u64 = 32;

/// All of it.
#[derive(Debug)]
pub(super) struct Memory {
    pub(super) counters: Counters,
    pub(super) gaussian: Option<PerGaussian>,
    pub(super) pair: Option<PerPair>,
    pub(super) band: Option<PerBand>,
}

impl Memory {
    pub(super) fn new(device: &Device) -> Self {
        let counters = Counters {
            frame: uniform(device, "frame", bytemuck::bytes_of(&Frame::zeroed())),
            gaussians: words(device, "gaussians", 1),
            slice_end: words(device, "slice end", 1),
            unfinished: words(device, "unfinished", 1),
            readback: readable(device, "counters", 12),
        };
        Self { counters, gaussian: None, pair: None, band: None }
    }

    /// Room for at least `count` Gaussians.
    pub(super) fn for_gaussians(&mut self, device: &Device, count: u64) {
        if self.gaussian.as_ref().is_some_and(|g| g.depths.capacity >= count) {
            return;
        }
        // What was there goes first.
        self.gaussian = None;
        self.gaussian = Some(PerGaussian {
            splats: storage(device, "splats", SPLAT * count),
            tints: storage(device, "tints", 16 * count),
            depths: Entries::new(device, "depths", count),
            offsets: Sums::new(device, "offsets", count + 1),
        });
    }

    /// Room for at least `count` pairs.
    pub(super) fn for_pairs(&mut self, device: &Device, count: u64) {
        if self.pair.as_ref().is_some_and(|p| p.tiles.capacity >= count) {
            return;
        }
        self.pair = None;
        self.pair = Some(PerPair {
            tiles: Entries::new(device, "tiles", count),
            splats: words(device, "pair splats", count),
        });
    }

    /// Room for a band of at least these sizes.
    pub(super) fn for_band(&mut self, device: &Device, tiles: u64, pixels: u64) {
        let fits = |b: &PerBand| b.ranges.size() >= 8 * tiles && b.picture.size() >= PIXEL * pixels;
        if self.band.as_ref().is_some_and(fits) {
            return;
        }
        self.band = None;
        let picture = storage(device, "picture", PIXEL * pixels);
        let readback = readable(device, "picture to read", picture.size());
        self.band = Some(PerBand { ranges: storage(device, "ranges", 8 * tiles), picture, readback });
    }

    /// What it takes on the device, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let gaussian = self
            .gaussian
            .as_ref()
            .map_or(0, |g| g.splats.size() + g.tints.size() + g.depths.bytes() + g.offsets.bytes());
        let pair = self.pair.as_ref().map_or(0, |p| p.tiles.bytes() + p.splats.size());
        let band = self.band.as_ref().map_or(0, |b| b.ranges.size() + 2 * b.picture.size());
        gaussian + pair + band
    }
}
