"""SSIM and PSNR of small images by scikit-image, with the window of the original paper.

    python scripts/golden/ssim_skimage.py tests/golden

Gaussian window, sigma 1.5, cut at 3.5 sigma (11 x 11), population covariance, mean over the
pixels at least 5 from the border and over the three channels. Images are 8-bit and are divided by
255 first, so the data range is 1.
"""

import numpy as np
import skimage
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

import golden


def picture(height, width):
    """A smooth picture with an edge, different in each channel."""
    v, u = np.mgrid[:height, :width]
    waves = [127 + 90 * np.sin(0.21 * u + 0.13 * v * k) + 30 * np.cos(0.5 * v - 0.1 * u * k) for k in (1, 2, 3)]
    out = np.stack(waves, -1)
    out[height // 3 : height // 2, width // 4 :] -= 60
    return out


def to_bytes(a):
    return np.clip(np.round(a), 0, 255).astype(np.uint8)


def case(name, a, b):
    x, y = a / 255.0, b / 255.0
    ssim = structural_similarity(
        x, y, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, channel_axis=-1
    )
    psnr = None if np.array_equal(a, b) else float(peak_signal_noise_ratio(x, y, data_range=1.0))
    return {
        "name": name,
        "width": a.shape[1],
        "height": a.shape[0],
        "a": a.ravel().tolist(),
        "b": b.ravel().tolist(),
        "ssim": float(ssim),
        "psnr": psnr,
    }


def main():
    rng = np.random.default_rng(14)
    small, tall = picture(20, 24), picture(47, 33)
    cases = [
        case("noise", to_bytes(small), to_bytes(small + rng.normal(size=small.shape) * 12)),
        case("shifted one pixel", to_bytes(tall), to_bytes(np.roll(tall, 1, axis=1))),
        case("darker", to_bytes(small), to_bytes(small * 0.7 + 5)),
        case("unrelated", to_bytes(rng.uniform(0, 255, small.shape)), to_bytes(small)),
        case("smallest that holds the window", to_bytes(picture(11, 11)), to_bytes(picture(11, 11) * 0.9)),
        case("identical", to_bytes(small), to_bytes(small)),
        case("flat white against flat grey", np.full((12, 16, 3), 255, np.uint8), np.full((12, 16, 3), 128, np.uint8)),
    ]
    value = {
        "source": f"scikit-image {skimage.__version__}",
        "layout": "row-major, interleaved RGB, 0..255; divided by 255 before the metric",
        "data_range": 1.0,
        "psnr_of_equal_images": "null: infinite",
        "cases": cases,
    }
    golden.write("ssim_skimage.json", value)


if __name__ == "__main__":
    main()
