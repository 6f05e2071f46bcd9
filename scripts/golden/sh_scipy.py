"""Real spherical harmonics in the order and sign of 3D Gaussian Splatting, from scipy's complex ones.

    python scripts/golden/sh_scipy.py tests/golden

scipy.special.sph_harm_y(l, m, theta, phi) is the orthonormal complex harmonic with the
Condon-Shortley phase (-1)^m, theta from +z and phi from +x. The usual real harmonics divide that
phase out again; 3DGS keeps it, hence Y1 = (-y, z, -x) * 0.4886:

    m < 0:  sqrt(2) Im Y_l^|m|        m = 0:  Y_l^0        m > 0:  sqrt(2) Re Y_l^m

with index l^2 + l + m, so m runs from -l to l within each degree. Coordinates are unit directions
as (x, y, z). No constant of any splatting code is used.
"""

import numpy as np
import scipy
from scipy.special import sph_harm_y

import golden

DEGREE = 3


def real_harmonics(d):
    phi = np.arctan2(d[1], d[0])
    # arccos(z) would lose digits near the poles.
    theta = np.arctan2(np.hypot(d[0], d[1]), d[2])
    out = []
    for l in range(DEGREE + 1):
        for m in range(-l, l + 1):
            y = complex(sph_harm_y(l, abs(m), theta, phi))
            out.append(np.sqrt(2) * y.imag if m < 0 else np.sqrt(2) * y.real if m > 0 else y.real)
    return [float(v) for v in out]


def main():
    rng = np.random.default_rng(15)
    directions = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(14, 3)), [[1e-6, -2e-6, 1.0]]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = np.array([real_harmonics(d) for d in directions])
    y1 = np.sqrt(3 / (4 * np.pi)) * np.stack([-directions[:, 1], directions[:, 2], -directions[:, 0]], 1)
    assert np.abs(values[:, 1:4] - y1).max() < 1e-15
    value = {"source": f"scipy {scipy.__version__}", "degree": DEGREE}
    golden.write("sh_scipy.json", {**value, "directions": directions.tolist(), "values": values.tolist()})


if __name__ == "__main__":
    main()
