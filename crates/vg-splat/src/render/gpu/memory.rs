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
}

/// Where the processor reads what a slice left.
#[derive(Debug)]
pub(super) struct Readback {
    /// How many pairs there were, the slice's end, and whether a pixel is not finished.
    pub(super) numbers: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
}

impl Readback {
    fn bytes(&self) -> u64 {
        self.numbers.size() + self.picture.size()
    }
}

/// What the way back needs.
#[derive(Debug)]
pub(super) struct Back {
    /// Of a band's pixels, as many as it has room for.
    pub(super) gradient: wgpu::Buffer,
    /// Of a window's tiles.
    pub(super) backgrounds: wgpu::Buffer,
    pub(super) backgrounds_readback: wgpu::Buffer,
    /// Of pairs.
    pub(super) shares: wgpu::Buffer,
    pub(super) sums: Vec<SplatSums>,
}

/// Sums of Gaussians that follow each other.
#[derive(Debug)]
pub(super) struct SplatSums {
    pub(super) count: usize,
    /// Number of the first Gaussian, and the count.
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
}

/// Bytes of what a slice says of itself.
pub(super) const NUMBERS: u64 = 12;
/// Bytes of a pixel: colour, alpha, depth.
pub(super) const PIXEL: u64 = 20;
/// Bytes of a splat.
pub(super) const SPLAT: u64 = 32;
/// Bytes that a pair has for its splat: `shares` of `shaders/back.wgsl`.
pub(super) const SHARE: u64 = 40;
/// Bytes of a splat's sums: `sums` of `shaders/gather.wgsl`.
pub(super) const SUMS: u64 = 44;
/// Bytes of a tile's gradient of the background.
pub(super) const BACKGROUND: u64 = 16;

/// What a frame is drawn of: the asset's id, and what of the frame matters.
pub(super) type Made = (u64, Frame);

/// All of it. What is submitted is done in its order, so that one is enough for all that follows; but for what the
/// processor reads, which it may come to after the next was submitted.
#[derive(Debug)]
pub(super) struct Memory {
    pub(super) counters: Counters,
    pub(super) gaussian: Option<PerGaussian>,
    pub(super) pair: Option<PerPair>,
    pub(super) band: Option<PerBand>,
    pub(super) back: Option<Back>,
    /// Those that nobody is to read.
    readbacks: Vec<Readback>,
    /// The asset whose last picture did not go in one slice.
    pub(super) in_slices: Option<u64>,
    /// Submissions that made lists of pairs.
    pub(super) listings: u64,
    /// Whose splats are there, in their order.
    pub(super) splats_of: Option<Made>,
    /// Whose pairs are listed, all of a window's, and how many there are.
    pub(super) pairs_of: Option<(Made, u32)>,
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
            in_slices: None,
            listings: 0,
            splats_of: None,
            pairs_of: None,
        }
    }

    /// Room for the processor to read the numbers and so many bytes of a picture. It is given back when it was read.
    pub(super) fn readback(&mut self, device: &Device, bytes: u64) -> Readback {
        if let Some(i) = self.readbacks.iter().position(|r| r.picture.size() >= bytes) {
            return self.readbacks.swap_remove(i);
        }
        // One that is too small goes first.
        self.readbacks.pop();
        Readback {
            numbers: readable(device, "numbers to read", NUMBERS),
            picture: readable(device, "picture to read", bytes.max(4)),
        }
    }

    /// What [`Memory::readback`] lent.
    pub(super) fn give_back(&mut self, readback: Readback) {
        self.readbacks.push(readback);
    }

    /// Room for at least `count` Gaussians.
    pub(super) fn for_gaussians(&mut self, device: &Device, count: u64) {
        if self.gaussian.as_ref().is_some_and(|g| g.depths.capacity >= count) {
            return;
        }
        // What was there goes first.
        self.gaussian = None;
        (self.splats_of, self.pairs_of) = (None, None);
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
        self.pairs_of = None;
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
        self.pairs_of = None;
        let picture = storage(device, "picture", PIXEL * pixels);
        self.band = Some(PerBand { ranges: storage(device, "ranges", 8 * tiles), picture });
    }

    /// Room to go back with `count` Gaussians and at least so many tiles and pixels of a band.
    pub(super) fn for_back(
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

    /// Room for the shares of `pairs` of them, or of as many as fit in a binding, once there is room to go back.
    pub(super) fn for_shares(&mut self, device: &Device, pairs: u64, largest_binding: u64) {
        let Some(back) = &mut self.back else { return };
        let bytes = SHARE * pairs.min(largest_binding / SHARE).max(1);
        if back.shares.size() < bytes {
            // What was there goes first.
            back.shares.destroy();
            back.shares = storage(device, "shares", bytes);
        }
    }

    /// What it takes on the device, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let gaussian = self
            .gaussian
            .as_ref()
            .map_or(0, |g| g.splats.size() + g.tints.size() + g.depths.bytes() + g.offsets.bytes());
        let pair = self.pair.as_ref().map_or(0, |p| p.tiles.bytes() + p.splats.size());
        let band = self.band.as_ref().map_or(0, |b| b.ranges.size() + b.picture.size());
        let back = self.back.as_ref().map_or(0, Back::bytes);
        let readbacks: u64 = self.readbacks.iter().map(Readback::bytes).sum();
        gaussian + pair + band + back + readbacks
    }
}
