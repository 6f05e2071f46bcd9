//! Structural similarity (Wang et al. 2004) with an 11x11 Gaussian window of sigma 1.5, as scikit-image computes
//! it with `gaussian_weights=True, use_sample_covariance=False, data_range=1`: the mean over channels and over
//! pixels whose window lies inside the picture.
//!
//! The code sums 1 - SSIM over windows and computes its exact adjoint, because an optimisation needs both at every
//! step. The part that depends on one picture alone is kept ([`Reference`]), and only windows that contain a difference
//! are evaluated: the others add 0. Rows are processed in parallel and summed in order.

use rayon::prelude::*;

const RADIUS: usize = 5;
/// Pixels across the window.
pub const WINDOW: usize = 2 * RADIUS + 1;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// SSIM of two RGB pictures in [0, 1] (values outside are clamped), `width` columns wide; `None` where the picture is
/// smaller than the window.
pub fn ssim(a: &[[f32; 3]], b: &[[f32; 3]], width: u32, height: u32) -> Option<f64> {
    let (w, h) = (width as usize, height as usize);
    assert!(a.len() == w * h && b.len() == w * h, "pictures of different sizes");
    if w < WINDOW || h < WINDOW {
        return None;
    }
    let reference = Reference::new(b, w, h);
    let windows = (w + 1 - WINDOW) * (h + 1 - WINDOW);
    Some(1.0 - reference.dissimilarity(a, 1.0 / (3 * windows) as f64, None, None))
}

/// A picture to compare others with.
#[derive(Clone, Debug)]
pub struct Reference {
    width: usize,
    height: usize,
    channels: [Channel; 3],
}

/// One channel, and its means in every window inside the picture.
#[derive(Clone, Debug)]
struct Channel {
    /// Values in [0, 1]. `[h * w]`
    values: Vec<f64>,
    /// Mean of each window. `[(h - 10) * (w - 10)]`
    mean: Vec<f64>,
    /// Mean of the squares in each window. `[(h - 10) * (w - 10)]`
    square: Vec<f64>,
}

/// The rectangle of pixels that covers all windows with a difference.
#[derive(Clone, Copy, Debug)]
struct Area {
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

impl Reference {
    /// Prepares a picture of `w * h` pixels, at least as large as the window.
    pub(crate) fn new(image: &[[f32; 3]], w: usize, h: usize) -> Self {
        let whole = Area { left: 0, top: 0, columns: w, rows: h };
        let channel = |c: usize| {
            let values: Vec<f64> = image.iter().map(|p| clamped(p, c)).collect();
            let across = whole.across(|v, [x, xx, _]| {
                for ((x, xx), value) in x.iter_mut().zip(xx).zip(&values[v * w..]) {
                    (*x, *xx) = (*value, value * value);
                }
            });
            let inner = w + 1 - WINDOW;
            let mut mean = vec![0.0; inner * (h + 1 - WINDOW)];
            let mut square = mean.clone();
            let rows = mean.par_chunks_exact_mut(inner).zip(square.par_chunks_exact_mut(inner));
            rows.enumerate().for_each(|(v, (mean, square))| {
                down(&across, [v, inner], 0, mean);
                down(&across, [v, inner], 1, square);
            });
            Channel { values, mean, square }
        };
        Self { width: w, height: h, channels: std::array::from_fn(channel) }
    }

    /// The sum of `1 - SSIM` over channels and windows, each weighted by `factor` times the `mask` at its middle. Adds
    /// the gradient to `slopes`; it is 0 for colours outside [0, 1]. `[h * w]` each.
    pub(crate) fn dissimilarity(
        &self,
        image: &[[f32; 3]],
        factor: f64,
        mask: Option<&[f32]>,
        mut slopes: Option<&mut [[f32; 3]]>,
    ) -> f64 {
        let Some(area) = self.differing(image) else { return 0.0 };
        (0..3).map(|c| self.channel_dissimilarity(c, area, image, factor, mask, slopes.as_deref_mut())).sum()
    }

    /// The area of windows that contain a difference; `None` where there is none.
    fn differing(&self, image: &[[f32; 3]]) -> Option<Area> {
        let (w, h) = (self.width, self.height);
        let differs = |i: usize| (0..3).any(|c| clamped(&image[i], c) != self.channels[c].values[i]);
        let columns = |v: usize| {
            let mut row = v * w..(v + 1) * w;
            let first = row.find(|i| differs(*i))?;
            Some([first - v * w, row.rfind(|i| differs(*i)).unwrap_or(first) - v * w, v, v])
        };
        let wider =
            |a: [usize; 4], b: [usize; 4]| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])];
        let [x0, x1, y0, y1] = (0..h).into_par_iter().filter_map(columns).reduce_with(wider)?;
        // First pixels of the first windows.
        let (left, top) = (x0.saturating_sub(WINDOW - 1), y0.saturating_sub(WINDOW - 1));
        let (right, bottom) = (x1.min(w - WINDOW), y1.min(h - WINDOW));
        Some(Area { left, top, columns: right - left + WINDOW, rows: bottom - top + WINDOW })
    }

    fn channel_dissimilarity(
        &self,
        c: usize,
        area: Area,
        image: &[[f32; 3]],
        factor: f64,
        mask: Option<&[f32]>,
        slopes: Option<&mut [[f32; 3]]>,
    ) -> f64 {
        let w = self.width;
        let Channel { values, mean, square } = &self.channels[c];
        let Area { left, top, columns, .. } = area;
        let inner = columns + 1 - WINDOW;
        let row = |v: usize| (top + v) * w + left;
        let across = area.across(|v, [x, xx, xy]| {
            let pixels = image[row(v)..].iter().zip(&values[row(v)..]);
            for (((x, xx), xy), (pixel, value)) in x.iter_mut().zip(xx).zip(xy).zip(pixels) {
                *x = clamped(pixel, c);
                (*xx, *xy) = (*x * *x, *x * value);
            }
        });

        // 1 - SSIM of each window, and its slopes spread along the row to each column.
        let mut back = vec![0.0; if slopes.is_some() { 3 * columns * (area.rows + 1 - WINDOW) } else { 0 }];
        let one = |v: usize, back: &mut [f64]| {
            let mut moments = [vec![0.0; inner], vec![0.0; inner], vec![0.0; inner]];
            for (plane, moment) in moments.iter_mut().enumerate() {
                down(&across, [v, inner], plane, moment);
            }
            let first = (top + v) * (w + 1 - WINDOW) + left;
            let middle = row(v) + RADIUS * w + RADIUS;
            let given = mean[first..].iter().zip(&square[first..]);
            let [x, xx, xy] = &mut moments;
            let mut lack = 0.0;
            for (i, (((x, xx), xy), (y, yy))) in x.iter_mut().zip(xx).zip(xy).zip(given).enumerate() {
                let weight = factor * mask.map_or(1.0, |m| f64::from(m[middle + i]));
                let window = Window { x: *x, xx: *xx, xy: *xy, y: *y, yy: *yy };
                let (ssim, slopes) = window.ssim();
                lack += weight * (1.0 - ssim);
                [*x, *xx, *xy] = slopes.map(|slope| -weight * slope);
            }
            for (moment, back) in moments.iter().zip(back.chunks_exact_mut(columns)) {
                // The window is symmetric, so spreading equals averaging of the slopes padded with zeros.
                let mut padded = vec![0.0; columns + WINDOW - 1];
                padded[WINDOW - 1..][..inner].copy_from_slice(moment);
                along(&padded, back);
            }
            lack
        };
        let windows = area.rows + 1 - WINDOW;
        let Some(slopes) = slopes else {
            let lacks: Vec<f64> = (0..windows).into_par_iter().map(|v| wide(|| one(v, &mut []))).collect();
            return lacks.iter().sum();
        };
        let rows = back.par_chunks_exact_mut(3 * columns).enumerate();
        let lacks: Vec<f64> = rows.map(|(v, back)| wide(|| one(v, back))).collect();

        let add = |v: usize, slopes: &mut [[f32; 3]]| {
            let mut spread = [vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]];
            for above in v.saturating_sub(WINDOW - 1)..=v.min(windows - 1) {
                let weight = KERNEL[v - above];
                let planes = back[above * 3 * columns..].chunks_exact(columns);
                for (spread, back) in spread.iter_mut().zip(planes) {
                    for (spread, back) in spread.iter_mut().zip(back) {
                        *spread += weight * back;
                    }
                }
            }
            let [d_x, d_xx, d_xy] = &spread;
            let d_moments = d_x.iter().zip(d_xx).zip(d_xy);
            let pixels = image[row(v)..].iter().zip(&values[row(v)..]);
            for ((slope, ((x, xx), xy)), (pixel, value)) in
                slopes[left..].iter_mut().zip(d_moments).zip(pixels)
            {
                if (0.0..=1.0).contains(&pixel[c]) {
                    slope[c] += (x + 2.0 * f64::from(pixel[c]) * xx + value * xy) as f32;
                }
            }
        };
        let rows = slopes.par_chunks_exact_mut(w).skip(top).take(area.rows).enumerate();
        rows.for_each(|(v, slopes)| wide(|| add(v, slopes)));
        lacks.iter().sum()
    }
}

impl Area {
    /// Averages of up to three planes, which `fill` makes, along each row: `[rows][3][columns - 10]`.
    fn across(self, fill: impl Fn(usize, [&mut [f64]; 3]) + Sync) -> Vec<f64> {
        let inner = self.columns + 1 - WINDOW;
        let mut out = vec![0.0; 3 * inner * self.rows];
        let planes = || vec![0.0; 3 * self.columns];
        out.par_chunks_exact_mut(3 * inner).enumerate().for_each_init(planes, |planes, (v, out)| {
            wide(|| {
                let (x, others) = planes.split_at_mut(self.columns);
                let (xx, xy) = others.split_at_mut(self.columns);
                fill(v, [x, xx, xy]);
                for (plane, out) in planes.chunks_exact(self.columns).zip(out.chunks_exact_mut(inner)) {
                    along(plane, out);
                }
            });
        });
        out
    }
}

/// The means of a window: x, its square, x y, y and its square.
struct Window {
    x: f64,
    xx: f64,
    xy: f64,
    y: f64,
    yy: f64,
}

impl Window {
    /// SSIM = luminance structure / (energy variance), and its derivatives by the means of x, x x and x y.
    #[inline(always)]
    fn ssim(&self) -> (f64, [f64; 3]) {
        let Self { x, xx, xy, y, yy } = *self;
        let luminance = 2.0 * x * y + C1;
        let structure = 2.0 * (xy - x * y) + C2;
        let energy = x * x + y * y + C1;
        let variance = (xx - x * x) + (yy - y * y) + C2;
        let below = 1.0 / (energy * variance);
        let ssim = luminance * structure * below;
        // The structure and the variance depend on x through -x y and -x^2 too.
        let d_x = 2.0 * y * (structure - luminance) * below + 2.0 * x * ssim * (energy - variance) * below;
        (ssim, [d_x, -ssim * energy * below, 2.0 * luminance * below])
    }
}

/// Channel `c` of the pixel, clamped to [0, 1].
#[inline(always)]
fn clamped(pixel: &[f32; 3], c: usize) -> f64 {
    f64::from(pixel[c].clamp(0.0, 1.0))
}

/// The window's weights in one direction: exp(-(i - 5)^2 / (2 1.5^2)), divided by their sum.
const KERNEL: [f64; WINDOW] = [
    0.001_028_380_084_479_111,
    0.007_598_758_135_239_185,
    0.036_000_772_128_430_83,
    0.109_360_689_509_700_02,
    0.213_005_537_711_253_7,
    0.266_011_724_861_794_36,
    0.213_005_537_711_253_7,
    0.109_360_689_509_700_02,
    0.036_000_772_128_430_83,
    0.007_598_758_135_239_185,
    0.001_028_380_084_479_111,
];

/// `out[i] = sum over k of KERNEL[k] x[i + k]`
#[inline(always)]
fn along(x: &[f64], out: &mut [f64]) {
    for (out, x) in out.iter_mut().zip(x.windows(WINDOW)) {
        let mut sum = 0.0;
        for (x, weight) in x.iter().zip(&KERNEL) {
            sum += weight * x;
        }
        *out = sum;
    }
}

/// One plane of the rows of [`Area::across`], averaged over the eleven from `v` on; rows have `inner` columns.
#[inline(always)]
fn down(across: &[f64], [v, inner]: [usize; 2], plane: usize, out: &mut [f64]) {
    out.fill(0.0);
    for (k, weight) in KERNEL.iter().enumerate() {
        let row = &across[(3 * (v + k) + plane) * inner..][..inner];
        for (out, x) in out.iter_mut().zip(row) {
            *out += weight * x;
        }
    }
}

/// Runs `work` compiled for the processor's widest vectors. Multiply-add is never fused, so every processor gives the
/// same bytes.
#[inline(always)]
fn wide<R>(work: impl FnOnce() -> R) -> R {
    #[allow(clippy::redundant_closure)] // only a closure can be inlined into the vectorised function
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || work(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_the_gaussian() {
        let weight = |i: usize| (-0.5 * ((i as f64 - RADIUS as f64) / 1.5).powi(2)).exp();
        let total: f64 = (0..WINDOW).map(weight).sum();
        for (i, k) in KERNEL.iter().enumerate() {
            assert!((k - weight(i) / total).abs() < 1e-16, "{i}: {k}, {}", weight(i) / total);
        }
    }

    /// 1 - SSIM of one channel, summed over windows, straight from the definition.
    fn by_definition(a: &[[f32; 3]], b: &[[f32; 3]], w: usize, h: usize, c: usize) -> f64 {
        let mut sum = 0.0;
        for top in 0..=h - WINDOW {
            for left in 0..=w - WINDOW {
                let mean = |of: &dyn Fn(f64, f64) -> f64| {
                    let mut mean = 0.0;
                    for (v, down) in KERNEL.iter().enumerate() {
                        for (u, along) in KERNEL.iter().enumerate() {
                            let i = (top + v) * w + left + u;
                            mean += down * along * of(clamped(&a[i], c), clamped(&b[i], c));
                        }
                    }
                    mean
                };
                let (x, y) = (mean(&|x, _| x), mean(&|_, y| y));
                let (xx, yy) = (mean(&|a, _| (a - x).powi(2)), mean(&|_, b| (b - y).powi(2)));
                let xy = mean(&|a, b| (a - x) * (b - y));
                let above = (2.0 * x * y + C1) * (2.0 * xy + C2);
                sum += 1.0 - above / ((x * x + y * y + C1) * (xx + yy + C2));
            }
        }
        sum
    }

    #[test]
    fn differences_anywhere_give_the_sum_of_the_definition() {
        let (w, h) = (24, 19);
        let image: Vec<[f32; 3]> =
            (0..w * h).map(|i| [0, 1, 2].map(|c| ((i * 7919 + c * 613) % 1100) as f32 / 1000.0)).collect();
        let reference = Reference::new(&image, w, h);
        assert_eq!(reference.dissimilarity(&image, 1.0, None, None), 0.0);
        for at in [0, 7, w - 1, 5 * w + 20, 18 * w + 3, h / 2 * w + w / 2, w * h - w, w * h - 1] {
            let mut other = image.clone();
            other[at][1] = 1.0 - other[at][1];
            let found = reference.dissimilarity(&other, 1.0, None, None);
            let expected: f64 = (0..3).map(|c| by_definition(&other, &image, w, h, c)).sum();
            assert!((found - expected).abs() < 1e-11, "{at}: {found}, {expected}");
        }
    }
}
