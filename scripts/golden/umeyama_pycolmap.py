"""Similarity between point sets: COLMAP's estimate from noisy pairs, checked twice.

    python scripts/golden/umeyama_pycolmap.py tests/golden

pycolmap.estimate_sim3d is the least-squares solution (Umeyama 1991), not a robust one. Before it is
written it is compared with scikit-image's estimate and with the formula in this file.
"""

import numpy as np
import pycolmap
import skimage
from skimage.transform import SimilarityTransform

import golden

NOISE = 0.02
AGREEMENT = 1e-10


def umeyama(src, dst):
    """scale, rotation, translation that minimise sum |dst - (scale R src + t)|^2."""
    a, b = src - src.mean(0), dst - dst.mean(0)
    u, d, vt = np.linalg.svd(b.T @ a / len(a))
    s = np.array([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u * s @ vt
    scale = (d * s).sum() / (a * a).sum() * len(a)
    return scale, rotation, dst.mean(0) - scale * rotation @ src.mean(0)


def case(name, src, rng, scale, noise):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.linalg.det(q)
    dst = scale * src @ q.T + rng.normal(size=3) * 5 + noise * scale * rng.normal(size=src.shape)
    found = pycolmap.estimate_sim3d(src, dst)
    rotation = found.rotation.matrix()
    other = SimilarityTransform.from_estimate(src, dst).params
    s, r, t = umeyama(src, dst)
    for linear, shift in ((other[:3, :3], other[:3, 3]), (s * r, t)):
        assert np.abs(linear - found.scale * rotation).max() < AGREEMENT * scale
        assert np.abs(shift - found.translation).max() < AGREEMENT * max(scale, 1) * 100
    return {
        "name": name,
        "src": src.tolist(),
        "dst": dst.tolist(),
        "scale": float(found.scale),
        "rotation": rotation.tolist(),
        "translation": found.translation.tolist(),
    }


def main():
    rng = np.random.default_rng(13)
    ring = lambda a: np.stack([6.5 * np.cos(a), 6.5 * np.sin(a), 0.8 + 0.3 * np.sin(3 * a)], -1)
    cases = [
        case("cloud", rng.normal(size=(8, 3)) * 2, rng, 2.7, NOISE),
        # Camera centres on a low ring, as around a vehicle: nearly planar.
        case("ring", ring(np.arange(9) * 2 * np.pi / 9), rng, 0.37, NOISE),
        # Noise larger than the height of a flat set: the plain SVD would give a reflection here.
        case("flat", rng.normal(size=(8, 3)) * (3, 2, 0.01), rng, 1.3, 0.15),
    ]
    source = f"pycolmap {pycolmap.__version__} estimate_sim3d, agrees with scikit-image {skimage.__version__}"
    golden.write("umeyama_pycolmap.json", {"source": source, "cases": cases})


if __name__ == "__main__":
    main()
