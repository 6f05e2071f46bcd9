"""Alignment: both interfaces give equal numbers, close to the truth, and errors for input that cannot be aligned."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import AXES, SEDAN, ellipsoid_view
from vehicle_gaussians import Alignment, Status, capi

FACES = [vg, capi]

#: Half the size, turned about z and tilted a little, moved.
WORLD_FROM_VEHICLE = np.array(
    [[0.0, -0.5, 0.0, 3.0], [0.48, 0.0, -0.14, -1.0], [0.14, 0.0, 0.48, 2.0], [0.0, 0.0, 0.0, 1.0]]
)


@pytest.fixture(scope="module")
def whole() -> vg.Scene:
    """The sample's photographs of both sides, with depth."""
    return vg.open_scene(SEDAN)


@pytest.fixture(scope="module")
def scan(whole: vg.Scene) -> npt.NDArray[np.float32]:
    """Points of the vehicle from the depth maps of the right side, in its frame, and their mirror images."""
    points = []
    for depth, mask, camera in zip(whole.depths, whole.masks, whole.cameras, strict=True):
        assert mask is not None
        if depth is None:
            continue
        v, u = np.nonzero(mask & (depth > 0))
        rays = np.stack([u + 0.5, v + 0.5, np.ones(len(u))], axis=1) @ np.linalg.inv(camera.K).T
        pose = camera.vehicle_from_camera
        points.append((rays * depth[v, u, None]) @ pose[:3, :3].T + pose[:3, 3])
    right = np.concatenate(points).astype(np.float32)[::3]
    return np.concatenate([right, right * np.array([1, -1, 1], np.float32)])


def in_world(cameras: list[vg.Camera]) -> list[vg.Camera]:
    """The cameras in a world of another gauge."""
    rotation = WORLD_FROM_VEHICLE[:3, :3] / 0.5
    moved = []
    for camera in cameras:
        pose = camera.vehicle_from_camera.copy()
        pose[:3, :3] = rotation @ pose[:3, :3]
        pose[:3, 3] = WORLD_FROM_VEHICLE[:3, :3] @ pose[:3, 3] + WORLD_FROM_VEHICLE[:3, 3]
        moved.append(camera.with_pose(pose))
    return moved


def same(a: Alignment, b: Alignment) -> bool:
    return a.vehicle_from_world.tobytes() == b.vehicle_from_world.tobytes() and a[1:7] == b[1:7]


def write_ply(path: Path, points: npt.NDArray[np.float32]) -> Path:
    lines = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{lines}end_header\n"
    path.write_bytes(header.encode() + np.ascontiguousarray(points, "<f4").tobytes())
    return path


def test_a_scan_tells_the_gauge_by_either_face(whole: vg.Scene, scan: npt.NDArray[np.float32]) -> None:
    arguments = (whole.masks, in_world(whole.cameras), scan)
    found = [face.align_scan(*arguments, names=whole.names) for face in FACES]
    # A pose that is passed as a matrix again is orthonormalised again.
    matrices = [one.vehicle_from_world for one in found]
    assert np.allclose(*matrices, rtol=0, atol=1e-12) and found[0][1:7] == pytest.approx(found[1][1:7], rel=1e-9)
    error = found[0].vehicle_from_world @ WORLD_FROM_VEHICLE - np.eye(4)
    assert np.abs(error[:3, :3]).max() < 0.02 and np.abs(error[:3, 3]).max() < 0.05
    assert found[0].scale == pytest.approx(2, rel=0.02) and found[0].used_count == len(whole.cameras)
    assert 0 < found[0].residual_m < 0.05 and 0.1 < found[0].confidence <= 1
    assert found[0].residual_px is not None and found[0].other_px is not None
    assert found[0].residual_px < found[0].other_px and found[0].kept is None
    turned = vg.align_scan(*arguments, heading="backward"), vg.align_scan(*arguments, heading="forward")
    assert turned[0].vehicle_from_world[0, :3] @ turned[1].vehicle_from_world[0, :3] < 0
    threads = [vg.align_scan(*arguments, names=whole.names, threads=n) for n in (1, 2)]
    assert same(*threads) and same(threads[0], found[0])


def test_a_folder_is_read_and_aligned(tmp_path: Path, scan: npt.NDArray[np.float32]) -> None:
    ply = write_ply(tmp_path / "scan.ply", scan)
    found = [face.align_folder(SEDAN, ply) for face in FACES]
    assert same(*found)
    known = np.array(json.loads((SEDAN / "vehicle_from_world.json").read_text())["vehicle_from_world"]).reshape(4, 4)
    error = found[0].vehicle_from_world @ np.linalg.inv(known) - np.eye(4)
    assert np.abs(error[:3, :3]).max() < 0.02 and np.abs(error[:3, 3]).max() < 0.05


def test_a_box_on_the_ground_tells_the_gauge_by_either_face() -> None:
    angles = 2 * np.pi * (np.arange(16) + 0.3) / 16
    ring = [(7 * np.cos(a), 7 * np.sin(a), 2.6 if i % 3 == 2 else 0.9) for i, a in enumerate(angles)]
    views = [ellipsoid_view(center, 320, 240) for center in ring]
    masks, cameras = [view[1] for view in views], in_world([view[3] for view in views])
    around = np.random.default_rng(5).uniform(-6, 6, (600, 3))
    around[:, 2] = -AXES[2] + around[:, 2] / 1000
    ground = around @ WORLD_FROM_VEHICLE[:3, :3].T + WORLD_FROM_VEHICLE[:3, 3]
    arguments = (masks, cameras, ground, 2 * AXES)
    found = [face.align_box(*arguments, heading="forward") for face in FACES]
    # As above.
    assert np.allclose(*(one.vehicle_from_world for one in found), rtol=0, atol=1e-9)
    assert found[0][1:4] == pytest.approx(found[1][1:4], rel=1e-9, abs=1e-9) and found[0][4:] == found[1][4:]
    error = found[0].vehicle_from_world @ WORLD_FROM_VEHICLE - np.eye(4)
    assert np.abs(error).max() < 0.1 and found[0].scale == pytest.approx(2, rel=0.05)
    assert (found[0].residual_px, found[0].other_px, found[0].used_count) == (None, None, 16)
    back = vg.align_box(*arguments, heading="backward")
    assert back.vehicle_from_world[0, :3] @ found[0].vehicle_from_world[0, :3] < 0


@pytest.mark.parametrize("face", FACES)
def test_points_that_contradict_the_others_are_left_out(face: Any) -> None:
    vehicle = np.random.default_rng(3).uniform(-5, 5, (9, 3))
    world = vehicle @ WORLD_FROM_VEHICLE[:3, :3].T + WORLD_FROM_VEHICLE[:3, 3]
    world[4] += 1.0
    found = face.align_points(world.tolist(), vehicle)
    assert found.kept.tolist() == [i != 4 for i in range(9)] and found.used_count == 8
    assert found.residuals_m[4] > 1 and found.residuals_m.argmax() == 4 and found.residual_m < 1e-9
    assert np.allclose(found.vehicle_from_world @ WORLD_FROM_VEHICLE, np.eye(4), atol=1e-9)
    assert found.scale == pytest.approx(2) and found.confidence == pytest.approx(5 / 6)
    assert (found.residual_px, found.other_px) == (None, None)


@pytest.mark.parametrize("face", FACES)
def test_what_cannot_be_aligned_is_named(face: Any, whole: vg.Scene, scan: npt.NDArray[np.float32]) -> None:
    views = (whole.masks, whole.cameras)
    broken = scan.copy()
    broken[2, 1] = np.nan
    ground, size = np.zeros((3, 3)), (4.5, 1.8, 1.5)
    for call, words in [
        (lambda: face.align_scan(whole.masks[1:], whole.cameras, scan), r"^masks: 7; allowed: one for each of 8"),
        (lambda: face.align_scan(*views, scan, names=["a"]), r"^names: 1; allowed"),
        (lambda: face.align_scan(*views, scan[:0]), r"^scan(_count)?: 0"),
        (lambda: face.align_scan(*views, broken), r"^scan\[2\]: "),
        (lambda: face.align_scan(*views, 1000 * scan), r"^scan: a box of .*in metres"),
        (lambda: face.align_scan(*views, scan[:, :2]), r"^scan: shape .*allowed: \(n, 3\)"),
        (lambda: face.align_scan(*views, scan, [[0, 0, np.nan]]), r"^sparse\[0\]: "),
        (lambda: face.align_scan(*views, scan, heading="left"), r"^heading: .left.; allowed: auto"),
        (lambda: face.align_scan([None] * 8, whole.cameras, scan), r"^views: 0 of 8 have a mask"),
        (lambda: face.align_box(*views, ground, size, heading="forward"), r"^sparse: 3 points that show no ground"),
        (lambda: face.align_box(*views, ground, (4500, 1800, 1500), heading="forward"), r"^size: "),
        (lambda: face.align_points(np.eye(3), np.eye(3)[:2]), r"^vehicle: 2; allowed: as many as world, 3"),
        (lambda: face.align_points(np.eye(3)[:2], np.eye(3)[:2]), r"^(count|world, vehicle): 2"),
        (lambda: face.align_folder(SEDAN), r"^scan(_path)?: .*holds no scan"),
    ]:
        with pytest.raises(vg.VgError, match=words) as caught:
            call()
        assert caught.value.code == Status.ARGUMENT
    with pytest.raises(vg.VgError, match=r"no\.ply") as caught:
        face.align_folder(SEDAN, "no.ply")
    assert caught.value.code == Status.IO
    with pytest.raises(TypeError, match="^scan: array of int32; allowed: an array of floats, metres"):
        face.align_scan(*views, scan.astype(np.int32))
