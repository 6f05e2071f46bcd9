"""Shared fixtures: the bundled sample, and an ellipsoid seen by four cameras whose every pixel is known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg

REPOSITORY = Path(__file__).resolve().parents[3]
SEDAN = REPOSITORY / "tests" / "data" / "sedan"
INPUTS = ("000", "001", "002", "003")
UNSEEN = ("004", "005", "006", "007")

#: Half axes of the ellipsoid, metres.
AXES = np.array([2.2, 0.9, 0.7])


@dataclass
class Views:
    images: list[npt.NDArray[np.uint8]]
    masks: list[npt.NDArray[np.bool_]]
    depths: list[npt.NDArray[np.float32]]
    cameras: list[vg.Camera]


def looking_at_the_origin(center: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """vehicle_from_camera, 4x4."""
    center = np.asarray(center, dtype=float)
    forward = -center / np.linalg.norm(center)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, np.cross(forward, right), forward, center])
    return pose


def ellipsoid_view(
    center: npt.ArrayLike, width: int = 96, height: int = 72
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_], npt.NDArray[np.float32], vg.Camera]:
    """Picture (coloured by position), mask and depth by ray casting through pixel centres."""
    pose = looking_at_the_origin(center)
    focal = 1.2 * width
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(u - K[0, 2]) / focal, (v - K[1, 2]) / focal, np.ones_like(u)], axis=-1)
    directions = rays @ pose[:3, :3].T / AXES
    origin = pose[:3, 3] / AXES
    a, b, c = (directions**2).sum(-1), directions @ origin, origin @ origin - 1.0
    root = b * b - a * c
    mask = root > 0.0
    depth = np.where(mask, (-b - np.sqrt(np.maximum(root, 0.0))) / a, 0.0)
    points = pose[:3, 3] + depth[..., None] * (rays @ pose[:3, :3].T)
    colors = np.where(mask[..., None], 0.5 + 0.4 * np.abs(points) / AXES, 1.0)
    image = np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)
    return image, mask, depth.astype(np.float32), vg.Camera.from_matrix(K, pose, width, height)


@pytest.fixture(scope="session")
def ellipsoid() -> Views:
    centers = [(6.0, -4.0, 0.8), (2.0, -6.5, 1.2), (-2.0, -6.5, 1.2), (-6.0, -4.0, 0.8)]
    views = [ellipsoid_view(center) for center in centers]
    images, masks, depths, cameras = (list(column) for column in zip(*views, strict=True))
    return Views(images, masks, depths, cameras)


@pytest.fixture(scope="session")
def sedan() -> vg.Scene:
    """The four photographs of the right side, with depth."""
    return vg.open_scene(SEDAN, INPUTS)


@pytest.fixture(scope="session")
def unseen() -> vg.Scene:
    """The four photographs of the left side."""
    return vg.open_scene(SEDAN, UNSEEN)


@pytest.fixture(scope="session")
def sedan_made(sedan: vg.Scene) -> vg.Reconstruction:
    return vg.reconstruct(sedan.images, sedan.masks, sedan.cameras, sedan.depths, names=sedan.names, points=True)


@pytest.fixture(scope="session")
def made(ellipsoid: Views) -> vg.Reconstruction:
    return vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths)


def on_white(image: npt.NDArray[np.uint8], mask: npt.NDArray[np.bool_] | None) -> npt.NDArray[np.uint8]:
    assert mask is not None
    return np.where(mask[..., None], image, np.uint8(255))


def psnr(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> float:
    """PSNR over the full frame, dB."""
    assert a.shape == b.shape and a.dtype == b.dtype == np.uint8
    error = np.mean((a.astype(float) - b.astype(float)) ** 2)
    return float(10 * np.log10(255.0**2 / error)) if error > 0 else math.inf


def same_bytes(a: vg.Gaussians, b: vg.Gaussians) -> bool:
    pairs = ((getattr(a, name), getattr(b, name)) for name in ("means", "scales", "quats", "opacities", "sh"))
    return all(x.shape == y.shape and x.tobytes() == y.tobytes() for x, y in pairs)
