//! Thousands of damaged files per reader: none may cause a panic, or an allocation by a size that the file claims
//! rather than by its content. The same readers are the targets of fuzz/, which needs a nightly compiler.
//!
//! Damage is seeded, so that a failure repeats; VG_MUTATIONS is the number of files per reader.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use vg_scene::io::depth::{self, DepthFormat};
use vg_scene::io::{colmap, image, ply, transforms, vehicle_frame};
use vg_splat::Gaussians;

/// The system's allocator, counting the bytes in use.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code)]
// SAFETY: every call goes to the system's allocator with the arguments it came with.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(IN_USE.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(IN_USE.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: as above. Zeroed pages stay untouched, and so unused, until they are written to.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// A damaged copy: bytes changed, numbers made extreme, ends cut off, pieces doubled or dropped.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    const EXTREME: [u64; 8] = [
        0,
        1,
        u64::MAX,
        i64::MAX as u64,
        0x7ff8_0000_0000_0000,
        0x7f80_0000_7f80_0000,
        1 << 32,
        0x2e2e_2f2e_2e2f,
    ];
    let mut out = bytes.to_vec();
    for _ in 0..=random.below(4) {
        // Headers are short and matter most, so they are damaged more often.
        let reach = if random.below(2) == 0 { out.len() } else { out.len().min(200) };
        let at = random.below(reach);
        let end = (at + random.below(64)).min(out.len());
        match random.below(8) {
            0 | 1 if !out.is_empty() => out[at] ^= 1 << random.below(8),
            2 if !out.is_empty() => out[at] = random.next() as u8,
            3 => out.truncate(at),
            4 | 5 => {
                let number = EXTREME[random.below(EXTREME.len())].to_le_bytes();
                let n = (out.len() - at).min(1 << random.below(4));
                out[at..at + n].copy_from_slice(&number[..n]);
            }
            6 => {
                let piece = out[at..end].to_vec();
                out.splice(at..at, piece);
            }
            _ => drop(out.drain(at..end)),
        }
    }
    out
}

fn read(path: impl AsRef<Path>) -> Vec<u8> {
    fs::read(vg_testing::root().join("tests/data").join(path)).unwrap()
}

fn gaussians(degree: u8) -> Vec<u8> {
    let sh = vec![0.25; 20 * vg_splat::gaussians::sh::coefficients(degree) * 3];
    let g = Gaussians::from_arrays(
        degree,
        vec![[1.0, 2.0, 3.0]; 20],
        vec![[0.5; 4]; 20],
        vec![[0.1; 3]; 20],
        vec![0.5; 20],
        sh,
    );
    let mut bytes = Vec::new();
    ply::write_to(&mut bytes, &g.unwrap()).unwrap();
    bytes
}

fn picture(format: ::image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let pixels = ::image::RgbImage::from_fn(40, 30, |u, v| ::image::Rgb([(u * 6) as u8, (v * 8) as u8, 99]));
    pixels.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn gray16() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let pixels = ::image::ImageBuffer::from_fn(40, 30, |u, v| ::image::Luma([(u * v) as u16]));
    ::image::DynamicImage::ImageLuma16(pixels).write_to(&mut bytes, ::image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn npy() -> Vec<u8> {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }   \n";
    let mut bytes = b"\x93NUMPY\x01\0".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend([0; 48]);
    bytes
}

fn exr() -> Vec<u8> {
    use ::exr::prelude::*;
    let channels = SpecificChannels::build().with_channel("Z").with_pixel_fn(|at| (at.x() as f32,));
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let layer = Layer::new((20, 10), LayerAttributes::default(), encoding, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

type Reader = (&'static str, Vec<u8>, usize, fn(&[u8]) -> bool);

/// Largest memory of a reader of a small file, for formats without pixels.
const SMALL: usize = 8 << 20;

/// Largest memory for pictures, which may be 8192 x 8192 before missing data is noticed: four bytes a pixel, and
/// decoder state.
const PIXELS: usize = 640 << 20;

fn readers() -> Vec<Reader> {
    vec![
        ("transforms.json", read("sedan/transforms.json"), SMALL, |b| {
            transforms::parse(b, Path::new("file")).is_ok()
        }),
        ("vehicle_from_world", read("sedan/vehicle_from_world.json"), SMALL, |b| {
            vehicle_frame::parse_vehicle_from_world(b, Path::new("file")).is_ok()
        }),
        ("matrix", b"2 0 0 1 0 2 0 1 0 0 2 1 0 0 0 1".to_vec(), SMALL, |b| {
            vehicle_frame::parse_matrix(b, Path::new("file")).is_ok()
        }),
        ("known centres", br#"{"a.png": [1, 2, 3], "b.png": [4, 5, 6]}"#.to_vec(), SMALL, |b| {
            vehicle_frame::parse_known_centers(b, Path::new("file")).is_ok()
        }),
        ("cameras.bin", read("colmap/bin/cameras.bin"), SMALL, |b| {
            colmap::cameras_from_binary(b, Path::new("file")).is_ok()
        }),
        ("images.bin", read("colmap/bin/images.bin"), SMALL, |b| {
            colmap::images_from_binary(b, Path::new("file")).is_ok()
        }),
        ("points3D.bin", read("colmap/bin/points3D.bin"), SMALL, |b| {
            colmap::points_from_binary(b, Path::new("file")).is_ok()
        }),
        ("cameras.txt", read("colmap/txt/cameras.txt"), SMALL, |b| {
            colmap::cameras_from_text(b, Path::new("file")).is_ok()
        }),
        ("images.txt", read("colmap/txt/images.txt"), SMALL, |b| {
            colmap::images_from_text(b, Path::new("file")).is_ok()
        }),
        ("points3D.txt", read("colmap/txt/points3D.txt"), SMALL, |b| {
            colmap::points_from_text(b, Path::new("file")).is_ok()
        }),
        ("PLY, degree 0", gaussians(0), SMALL, |b| {
            ply::read_from(b, b.len() as u64, Path::new("file")).is_ok()
        }),
        ("PLY, degree 3", gaussians(3), SMALL, |b| {
            ply::read_from(b, b.len() as u64, Path::new("file")).is_ok()
        }),
        ("PLY, points", gaussians(0), SMALL, |b| {
            ply::read_points_from(b, b.len() as u64, Path::new("file")).is_ok()
        }),
        ("npy", npy(), SMALL, |b| depth::decode(DepthFormat::Npy, b, Path::new("file"), 1.0).is_ok()),
        ("pfm", b"Pf\n3 2\n-1.0\nabcdabcdabcdabcdabcdabcd".to_vec(), SMALL, |b| {
            depth::decode(DepthFormat::Pfm, b, Path::new("file"), 1.0).is_ok()
        }),
        ("exr", exr(), PIXELS, |b| depth::decode(DepthFormat::Exr, b, Path::new("file"), 1.0).is_ok()),
        ("depth PNG", gray16(), PIXELS, |b| {
            depth::decode(DepthFormat::Png, b, Path::new("file"), 1e-3).is_ok()
        }),
        ("PNG", picture(::image::ImageFormat::Png), PIXELS, |b| image::decode(b, Path::new("file")).is_ok()),
        ("JPEG", picture(::image::ImageFormat::Jpeg), PIXELS, |b| {
            image::decode(b, Path::new("file")).is_ok()
        }),
    ]
}

#[test]
fn damaged_files_never_panic_and_never_make_a_reader_allocate_by_what_they_claim() {
    let mutations = std::env::var("VG_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(3000usize);
    for (name, valid, most_bytes, accepts) in readers() {
        assert!(accepts(&valid), "{name}: the reader refuses the undamaged file");
        let mut random = Random(0x9e37_79b9_7f4a_7c15);
        let (mut accepted, mut largest) = (0, 0);
        for i in 0..mutations {
            let bytes = damaged(&valid, &mut random);
            let before = IN_USE.load(Relaxed);
            PEAK.store(before, Relaxed);
            let outcome = catch_unwind(AssertUnwindSafe(|| accepts(&bytes)));
            let used = PEAK.load(Relaxed).saturating_sub(before);
            largest = largest.max(used);
            match outcome {
                Ok(true) => accepted += 1,
                Ok(false) => {}
                Err(_) => panic!("{name}: damaged file {i} made the reader panic: {:?}", dump(&bytes)),
            }
            assert!(used <= most_bytes, "{name}: damaged file {i} took {used} bytes: {:?}", dump(&bytes));
        }
        println!(
            "{name}: {mutations} damaged files, {accepted} still read, at most {} kB used",
            largest / 1024
        );
    }
}

/// The beginning of the file as text, for the message.
fn dump(bytes: &[u8]) -> String {
    bytes.iter().take(600).flat_map(|b| std::ascii::escape_default(*b)).map(char::from).collect()
}
