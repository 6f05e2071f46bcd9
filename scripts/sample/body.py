"""The body shell of the sedan as an implicit surface: negative inside, zero on the sheet metal.

Two rounded volumes, the lower body and the cabin, each a smooth intersection of simple sheets,
joined by a smooth union. Here the ground is z = 0 and x = 0 lies near the middle of the car; the
caller moves the finished car so that the origin is the centre of its bounding box.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from skimage.measure import marching_cubes

from mesh import Mesh

FRONT_AXLE, REAR_AXLE = 1.38, -1.34  # x of the axles
WHEEL_RADIUS = 0.33
ARCH_RADIUS = 0.385

_TOP = CubicSpline(
    [-2.45, -2.15, -1.75, -1.2, -0.3, 0.5, 1.0, 1.5, 2.0, 2.45],
    [0.975, 1.005, 1.00, 0.97, 0.935, 0.915, 0.905, 0.865, 0.765, 0.60],
)


def smooth_max(a, b, k):
    """Maximum with a fillet of width k: where |a - b| < k the corner is rounded."""
    h = np.maximum(k - np.abs(a - b), 0) / k
    return np.maximum(a, b) + h * h * k / 4


def smooth_min(a, b, k):
    return -smooth_max(-a, -b, k)


def step(t):
    """Logistic step from 0 to 1."""
    return 0.5 * (1 + np.tanh(t))


def half_width(x, z):
    """Half the width of the lower body at station x and height z."""
    w = 0.872 - 0.075 * np.abs(x / 2.25) ** 3.5
    w = w - 0.045 * (np.maximum(0.55 - z, 0) / 0.35) ** 2
    w = w - 0.065 * (np.maximum(z - 0.55, 0) / 0.45) ** 2
    # Character line: the side steps in just above it and catches the sky.
    line = 0.795 - 0.028 * x
    w = w - 0.016 * step((z - line) / 0.012) * np.exp(-((x / 2.0) ** 6))
    # Scallop low on the doors, and a flare around each wheel.
    w = w - 0.022 * np.exp(-(((z - 0.40) / 0.075) ** 2)) * step((0.85 - x) / 0.1) * step((x + 0.8) / 0.1)
    for axle in (FRONT_AXLE, REAR_AXLE):
        r = np.hypot(x - axle, z - WHEEL_RADIUS)
        w = w + 0.024 * np.exp(-(((r - ARCH_RADIUS) / 0.06) ** 2))
    return w


def cabin_half_width(x, z):
    return 0.782 - 0.44 * (z - 0.95) - 0.035 * (x + 0.35) ** 2


def windscreen(x, a, z):
    """Signed distance in front of the windscreen, curved in plan; a = |y|."""
    return (x - 1.05 + 0.16 * a * a) * 0.515 + (z - 0.91) * 0.857


def rear_window(x, a, z):
    return -(x + 1.86 - 0.12 * a * a) * 0.385 + (z - 1.01) * 0.923


def roof(x, a, z):
    return z - (1.45 - 0.05 * (x + 0.25) ** 2 - 0.05 * (a / 0.6) ** 2)


def shell(p):
    """The implicit function at points [..., 3]."""
    x, a, z = p[..., 0], np.abs(p[..., 1]), p[..., 2]
    top = z - (_TOP(x) - 0.035 * (a / 0.8) ** 2 - 0.006 * step((a - 0.52) / 0.03) * step((x - 0.9) / 0.2))
    side = a - half_width(x, z)
    nose = x - (
        2.31 - 0.30 * (a / 0.88) ** 2.6 - 0.9 * np.maximum(z - 0.50, 0) ** 2 - 0.5 * np.maximum(0.42 - z, 0) ** 2
    )
    tail = -x - (2.30 - 0.20 * (a / 0.88) ** 2.8 - 0.7 * np.maximum(0.45 - z, 0) ** 2 - 0.12 * np.maximum(z - 0.64, 0))
    floor = 0.185 + 0.05 * np.maximum(np.abs(x) - 1.7, 0) - z
    lower = smooth_max(side, top, 0.11)
    lower = smooth_max(lower, nose, 0.16)
    lower = smooth_max(lower, tail, 0.12)
    lower = smooth_max(lower, floor, 0.07)
    cabin = smooth_max(windscreen(x, a, z), roof(x, a, z), 0.14)
    cabin = smooth_max(cabin, rear_window(x, a, z), 0.22)
    cabin = smooth_max(cabin, 0.91 * (a - cabin_half_width(x, z)), 0.09)
    cabin = smooth_max(cabin, 0.90 - z, 0.05)  # else the rear window plane runs out over the boot
    return smooth_min(lower, cabin, 0.05)


def gradient(p, h=1e-4):
    g = np.empty_like(p)
    for k in range(3):
        e = np.zeros(3)
        e[k] = h
        g[..., k] = (shell(p + e) - shell(p - e)) / (2 * h)
    return g


def shell_mesh(cell):
    """The half y >= 0 of the shell, its boundary exactly on y = 0, so that it can be mirrored."""
    low, high = np.array([-2.42, 0.0, 0.10]), np.array([2.42, 0.98, 1.55])
    axes = [l + cell * np.arange(int(np.ceil((h - l) / cell)) + 1) for l, h in zip(low, high)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    points, faces, _, _ = marching_cubes(shell(grid), 0.0)
    points = points.astype(float) * cell + low
    on_seam = points[:, 1] < 1e-6
    for _ in range(4):  # Newton steps from the cell edges onto the surface itself
        g = gradient(points)
        points = points - g * (shell(points) / (g * g).sum(-1))[:, None]
        points[on_seam, 1] = 0.0
    normals = gradient(points)
    normals[on_seam, 1] = 0.0
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    p = points[faces]
    outward = (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) * normals[faces[:, 0]]).sum(1)
    if outward.sum() < 0:
        faces = faces[:, ::-1]
    return Mesh(points, normals, faces)


def surface_y(x, z):
    """y > 0 where the line through (x, z) parallel to y leaves the shell."""
    x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
    low, high = np.zeros_like(x), np.ones_like(x)
    for _ in range(50):
        mid = (low + high) / 2
        inside = shell(np.stack([x, mid, z], -1)) < 0
        low, high = np.where(inside, mid, low), np.where(inside, high, mid)
    return (low + high) / 2
