//! Evaluation of the shape network: a U-Net of 3 x 3 convolutions whose input and output channels are slices along |y|.
//!
//! `training/shape/network.py` is its twin. Weights are float16 in the file and f32 here. Products are added in one
//! fixed order, without fused instructions, for the same bytes on every machine and with any number of threads.

use rayon::prelude::*;
use std::sync::OnceLock;
use vg_geometry::{Error, Result};

/// Weights trained on procedural vehicles; `training/README.md` describes how to train them again.
static WEIGHTS: &[u8] = include_bytes!("weights.bin");

const MAGIC: &[u8; 8] = b"VGSHAPE1";

/// A convolution with bias: `[out][in][3][3]`.
struct Layer {
    outputs: usize,
    inputs: usize,
    weights: Vec<f32>,
    biases: Vec<f32>,
}

/// All layers in order; see [`Network::run`].
pub(crate) struct Network {
    layers: Vec<Layer>,
}

/// Planes of channels, padded with zeros one pixel wide. `[channels][height + 2][width + 2]`
#[derive(Clone)]
pub(crate) struct Planes {
    channels: usize,
    height: usize,
    width: usize,
    values: Vec<f32>,
}

impl Planes {
    /// Planes of zeros.
    pub(crate) fn new(channels: usize, height: usize, width: usize) -> Self {
        Self { channels, height, width, values: vec![0.0; channels * (height + 2) * (width + 2)] }
    }

    /// Row `v` of a channel, without the padding.
    pub(crate) fn row_mut(&mut self, channel: usize, v: usize) -> &mut [f32] {
        let stride = self.width + 2;
        let start = (channel * (self.height + 2) + v + 1) * stride + 1;
        &mut self.values[start..start + self.width]
    }

    /// Row `v` of a channel, without the padding.
    pub(crate) fn row(&self, channel: usize, v: usize) -> &[f32] {
        let stride = self.width + 2;
        let start = (channel * (self.height + 2) + v + 1) * stride + 1;
        &self.values[start..start + self.width]
    }

    /// Nearest-neighbour upsampling by two, with the channels of `skip` appended.
    fn doubled_with(&self, skip: &Self) -> Self {
        let mut out = Self::new(self.channels + skip.channels, skip.height, skip.width);
        for channel in 0..self.channels {
            for v in 0..out.height {
                let from = self.row(channel, v / 2);
                for (u, value) in out.row_mut(channel, v).iter_mut().enumerate() {
                    *value = from[u / 2];
                }
            }
        }
        let start = self.channels * (out.height + 2) * (out.width + 2);
        out.values[start..].copy_from_slice(&skip.values);
        out
    }
}

impl Network {
    /// The network that is compiled into the library.
    pub(crate) fn embedded() -> Result<&'static Self> {
        static NETWORK: OnceLock<Option<Network>> = OnceLock::new();
        NETWORK.get_or_init(|| Self::read(WEIGHTS)).as_ref().ok_or_else(|| Error::Reconstruction {
            stage: "prior",
            reason: "the weights of the shape network inside this library are damaged".into(),
        })
    }

    fn read(bytes: &[u8]) -> Option<Self> {
        let mut numbers =
            bytes.strip_prefix(MAGIC)?.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
        let count = usize::from(numbers.next()?);
        let mut layers = Vec::with_capacity(count);
        for _ in 0..count {
            let [outputs, inputs, side] =
                [numbers.next()?, numbers.next()?, numbers.next()?].map(usize::from);
            if side != 3 {
                return None;
            }
            let mut take = |n: usize| -> Option<Vec<f32>> {
                let values: Vec<f32> = numbers.by_ref().take(n).map(f32_from_f16).collect();
                (values.len() == n).then_some(values)
            };
            let (weights, biases) = (take(outputs * inputs * 9)?, take(outputs)?);
            layers.push(Layer { outputs, inputs, weights, biases });
        }
        (layers.len() == 13 && numbers.next().is_none()).then_some(Self { layers })
    }

    /// Channels of the input and of the output.
    #[cfg(test)]
    fn ends(&self) -> (usize, usize) {
        (self.layers[0].inputs, self.layers[12].outputs)
    }

    /// Maps `[inputs][32][96]` to `[outputs][32][96]`, on the current thread pool.
    pub(crate) fn run(&self, input: &Planes) -> Planes {
        let layer = |i: usize, x: &Planes| self.layers[i].run::<1>(x, true);
        let halved = |i: usize, x: &Planes| self.layers[i].run::<2>(x, true);
        let full = layer(1, &layer(0, input));
        let half = layer(3, &halved(2, &full));
        let quarter = layer(5, &halved(4, &half));
        let deep = layer(8, &layer(7, &halved(6, &quarter)));
        let quarter = layer(9, &deep.doubled_with(&quarter));
        let half = layer(10, &quarter.doubled_with(&half));
        let full = layer(11, &half.doubled_with(&full));
        self.layers[12].run::<1>(&full, false)
    }
}

/// Output channels that share one pass over the input.
const TOGETHER: usize = 4;

/// Width of the widest row, the lattice's.
const MOST_COLUMNS: usize = super::lattice::NODES[0];

impl Layer {
    /// The zero-padded convolution, followed by max(0, x) if `rectified`.
    fn run<const STRIDE: usize>(&self, x: &Planes, rectified: bool) -> Planes {
        debug_assert_eq!((x.channels, self.outputs % TOGETHER), (self.inputs, 0));
        let mut out = Planes::new(self.outputs, x.height / STRIDE, x.width / STRIDE);
        let (height, width) = (out.height, out.width);
        let plane = (height + 2) * (width + 2);
        out.values.par_chunks_mut(TOGETHER * plane).enumerate().for_each(|(group, planes)| {
            pulp::Arch::new().dispatch(
                #[inline(always)]
                || {
                    for v in 0..height {
                        let sums = self.row_sums::<STRIDE>(x, group * TOGETHER, v, width);
                        for (o, sums) in sums.iter().enumerate() {
                            let start = o * plane + (v + 1) * (width + 2) + 1;
                            for (value, &sum) in planes[start..start + width].iter_mut().zip(sums) {
                                *value = if rectified { sum.max(0.0) } else { sum };
                            }
                        }
                    }
                },
            );
        });
        out
    }

    /// Row `v` of [`TOGETHER`] output channels from `first` on.
    #[inline(always)]
    fn row_sums<const STRIDE: usize>(
        &self,
        x: &Planes,
        first: usize,
        v: usize,
        width: usize,
    ) -> [[f32; MOST_COLUMNS]; TOGETHER] {
        let mut sums: [[f32; MOST_COLUMNS]; TOGETHER] =
            std::array::from_fn(|o| [self.biases[first + o]; MOST_COLUMNS]);
        let [a, b, c, d] = &mut sums;
        let (a, b, c, d) = (&mut a[..width], &mut b[..width], &mut c[..width], &mut d[..width]);
        let stride = x.width + 2;
        for channel in 0..self.inputs {
            for dv in 0..3 {
                let start = (channel * (x.height + 2) + STRIDE * v + dv) * stride;
                let row = &x.values[start..start + stride];
                for du in 0..3 {
                    let weight =
                        |o: usize| self.weights[((first + o) * self.inputs + channel) * 9 + 3 * dv + du];
                    let w: [f32; TOGETHER] = std::array::from_fn(weight);
                    let from = row[du..].iter().step_by(STRIDE);
                    for ((((a, b), c), d), &x) in
                        a.iter_mut().zip(&mut *b).zip(&mut *c).zip(&mut *d).zip(from)
                    {
                        *a += w[0] * x;
                        *b += w[1] * x;
                        *c += w[2] * x;
                        *d += w[3] * x;
                    }
                }
            }
        }
        sums
    }
}

/// Converts IEEE 754 half precision, exactly.
fn f32_from_f16(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let (exponent, fraction) = (u32::from(bits >> 10 & 0x1f), u32::from(bits & 0x3ff));
    let magnitude = match exponent {
        // Subnormal: fraction * 2^-24.
        0 => (fraction as f32 / 16_777_216.0).to_bits(),
        31 => 0x7f80_0000 | fraction << 13,
        _ => (exponent + 112) << 23 | fraction << 13,
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use super::super::lattice::{NODES, VIEW_NUMBERS};
    use super::super::network_input;
    use super::*;

    /// Output of `training/shape/parity.py`: a hull as int8, view numbers, every 29th value of the network's output.
    static PARITY: &[u8] = include_bytes!("../../../../../tests/data/shape/parity.bin");

    fn parity() -> (Planes, Vec<f32>) {
        let [nx, ny, nz] = NODES;
        let (hull, rest) = PARITY.split_at(nx * ny * nz);
        // The file holds units of 0.5 m over 127.
        let hull: Vec<f32> = hull.iter().map(|b| f32::from(*b as i8) / 254.0).collect();
        let floats: Vec<f32> =
            rest.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let numbers: [f32; VIEW_NUMBERS] = std::array::from_fn(|i| floats[i]);
        (network_input(&hull, &numbers), floats[VIEW_NUMBERS..].to_vec())
    }

    #[test]
    fn the_output_equals_that_of_the_trained_network() {
        let (input, expected) = parity();
        let network = Network::embedded().unwrap();
        assert_eq!(network.ends(), (input.channels, 2 * NODES[1]));
        let answer = network.run(&input);
        let flat: Vec<f32> = (0..answer.channels)
            .flat_map(|c| (0..answer.height).map(move |v| (c, v)))
            .flat_map(|(c, v)| answer.row(c, v).to_vec())
            .collect();
        let (mut worst, mut largest) = (0.0f32, 0.0f32);
        for (found, expected) in flat.iter().step_by(29).zip(&expected) {
            worst = worst.max((found - expected).abs());
            largest = largest.max(expected.abs());
        }
        assert_eq!(expected.len(), flat.len().div_ceil(29));
        // The reference sums some thousand f32 products in another order.
        assert!(worst < 1e-4 * largest && largest > 0.5, "{worst} of {largest}");
    }

    #[test]
    fn a_stride_of_two_takes_every_other_value() {
        let identity = |outputs: usize, inputs: usize| {
            let mut weights = vec![0.0; outputs * inputs * 9];
            for o in 0..outputs {
                weights[(o * inputs) * 9 + 4] = (o + 1) as f32;
            }
            Layer { outputs, inputs, weights, biases: vec![0.5; outputs] }
        };
        let mut x = Planes::new(1, 4, 6);
        for v in 0..4 {
            for (u, value) in x.row_mut(0, v).iter_mut().enumerate() {
                *value = (10 * v + u) as f32 - 12.0;
            }
        }
        let out = identity(4, 1).run::<2>(&x, false);
        assert_eq!(out.row(2, 1), [3.0 * 8.0 + 0.5, 3.0 * 10.0 + 0.5, 3.0 * 12.0 + 0.5]);
        let rectified = identity(4, 1).run::<1>(&x, true);
        assert_eq!(rectified.row(0, 1), [0.0, 0.0, 0.5, 1.5, 2.5, 3.5]);
    }

    #[test]
    fn half_precision_is_read_exactly() {
        for (bits, value) in [(0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (0x0001, 5.960_464_5e-8)]
        {
            assert_eq!(f32_from_f16(bits), value);
        }
        assert_eq!(f32_from_f16(0x7c00), f32::INFINITY);
    }

    #[test]
    fn damaged_weights_are_noticed() {
        assert!(Network::read(WEIGHTS).is_some());
        assert!(Network::read(&WEIGHTS[..WEIGHTS.len() - 2]).is_none());
        assert!(Network::read(&WEIGHTS[1..]).is_none());
        assert!(WEIGHTS.len() <= 2 << 20, "the library's limit for weights is 2 MB");
    }
}
