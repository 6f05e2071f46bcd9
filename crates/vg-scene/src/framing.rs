//! Input pictures of a network: their size, the resampling of photographs, and the normalisation of colours. Read from
//! its ports and metadata (docs/ONNX.md).

use crate::onnx::{Broken, Ports};

/// Method of resampling a photograph to the network's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resize {
    /// Scaled uniformly to cover the picture; the excess is cropped on both sides.
    CoverCrop,
    /// Width and height scaled independently.
    Stretch,
}

/// Width and height of the network's pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Size {
    Fixed(u32, u32),
    /// Long side, and the number of which both sides are multiples.
    Free {
        long_side: u32,
        multiple: u32,
    },
}

/// Format of a network's input pictures.
#[derive(Clone, Copy, Debug)]
pub struct Framing {
    /// How pictures are brought to the size.
    pub resize: Resize,
    size: Size,
    /// Mean that is subtracted from colours in [0, 1].
    pub(crate) mean: [f32; 3],
    /// Divisor of the colours after the subtraction.
    pub(crate) std: [f32; 3],
    /// The number of views per run, if it is fixed.
    pub views: Option<usize>,
}

/// Longest side of pictures for a network that takes any size.
const LONG_SIDE: u32 = 518;

impl Framing {
    /// Reads the format from the input `images` and the metadata; `resize` is the default method.
    pub fn read(ports: &Ports, resize: Resize) -> Result<Self, Broken> {
        let methods = [("cover_crop", Resize::CoverCrop), ("stretch", Resize::Stretch)];
        let resize = ports.one_of("vg.resize", &methods, Some(resize))?;
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
                let (width, height) = sides
                    .ok_or_else(|| Broken::new("input images", "a side out of range; allowed: 1 to 8192"))?;
                Size::Fixed(width, height)
            }
            (None, None) if long_side < multiple => {
                let reason = format!("{long_side}; allowed: at least vg.size_multiple, {multiple}");
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

    /// Width and height of the network's picture for photographs of mean `aspect` = width / height.
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
