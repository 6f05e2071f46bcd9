//! What pictures a network takes: their size, how photographs come to it, and the scale of colours. Read off its
//! ports and metadata (docs/ONNX.md).

use crate::onnx::{Broken, Ports};

/// How a photograph comes to the network's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resize {
    /// Scaled evenly to cover it; what is over is cut on both sides.
    CoverCrop,
    /// Width and height each to its own.
    Stretch,
}

/// Width and height of the network's pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Size {
    Fixed(u32, u32),
    /// The long side, and what both sides are multiples of.
    Free {
        long_side: u32,
        multiple: u32,
    },
}

/// The pictures that a network takes.
#[derive(Clone, Copy, Debug)]
pub struct Framing {
    /// How pictures are brought to the size.
    pub resize: Resize,
    size: Size,
    /// Taken off the colours in [0, 1], which are then divided by `std`.
    pub(crate) mean: [f32; 3],
    pub(crate) std: [f32; 3],
    /// How many views it takes at once, where that is fixed.
    pub views: Option<usize>,
}

/// Longest side of pictures for a network that takes any size.
const LONG_SIDE: u32 = 518;

impl Framing {
    /// From the input `images` and the metadata; `resize` where the model says nothing of it.
    pub fn read(ports: &Ports, resize: Resize) -> Result<Self, Broken> {
        let ways = [("cover_crop", Resize::CoverCrop), ("stretch", Resize::Stretch)];
        let resize = ports.one_of("vg.resize", &ways, Some(resize))?;
        let multiple = ports.count("vg.size_multiple", 1)?;
        let long_side = ports.count("vg.long_side", LONG_SIDE)?;
        let mean = ports.color("vg.mean", [0.0; 3])?;
        let std = ports.color("vg.std", [1.0; 3])?;
        if std.contains(&0.0) {
            return Err(Broken::new("metadata vg.std", format!("{std:?}; allowed: no zeros")));
        }
        let images = ports.required_input("images", &[None, Some(3), None, None])?;
        let size = match (images[2], images[3]) {
            (Some(height), Some(width)) => {
                let side = |n: usize| u32::try_from(n).ok().filter(|n| (1..=8192).contains(n));
                let sides = side(width).zip(side(height));
                let (width, height) =
                    sides.ok_or_else(|| Broken::new("input images", "sides beyond 1 to 8192"))?;
                Size::Fixed(width, height)
            }
            (None, None) if long_side < multiple => {
                let reason = format!("{long_side}, less than vg.size_multiple {multiple}");
                return Err(Broken::new("metadata vg.long_side", reason));
            }
            (None, None) => Size::Free { long_side, multiple },
            _ => {
                return Err(Broken::new(
                    "input images",
                    "one side fixed and one free; allowed: both or none",
                ));
            }
        };
        Ok(Self { resize, size, mean, std, views: images[0] })
    }

    /// Width and height for photographs of `aspect` = width / height on the mean.
    pub fn size_for(&self, aspect: f64) -> (u32, u32) {
        match self.size {
            Size::Fixed(width, height) => (width, height),
            Size::Free { long_side, multiple } => {
                let long = (long_side / multiple).max(1) * multiple;
                let short = f64::from(long) * aspect.min(1.0 / aspect) / f64::from(multiple);
                let short = (short.round() as u32).max(1) * multiple;
                if aspect >= 1.0 { (long, short) } else { (short, long) }
            }
        }
    }
}
