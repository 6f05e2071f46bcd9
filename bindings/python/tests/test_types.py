"""Legal calls pass ``mypy --strict`` and run; illegal calls fail both.

The comments that silence mypy are checked, too: one that silences nothing is an error.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, assert_type

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views
from vehicle_gaussians import capi

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]


def test_pictures_have_the_type_that_the_options_ask_for(made: vg.Reconstruction, ellipsoid: Views) -> None:
    car, camera = made.gaussians, ellipsoid.cameras[0]
    want = bool(len(car))
    assert_type(car.render(camera), Bytes)
    assert_type(car.render(camera, (0.2, 0.5, 0.9), dtype=np.float32), Floats)
    assert_type(car.render(camera, [0, 0, 1], False, 1, dtype="float32"), Floats)
    assert_type(car.render(camera, np.ones(3), dtype=np.dtype(np.float32)), Floats)
    assert_type(car.render(camera, depth=True), tuple[Bytes, Floats])
    assert_type(car.render(camera, "white", True), tuple[Bytes, Floats])
    assert_type(car.render(camera, "transparent", True, dtype="float32"), tuple[Floats, Floats])
    assert_type(car.render(camera, depth=True, dtype=np.float32), tuple[Floats, Floats])
    either = car.render(camera, depth=want)
    assert_type(either, Bytes | tuple[Bytes, Floats])
    assert isinstance(either, tuple)
    assert_type(vg.Renderer(car, "cpu").render_many(ellipsoid.cameras), list[Bytes])


def test_what_is_legal_passes(made: vg.Reconstruction, ellipsoid: Views, tmp_path: Path) -> None:
    scene = vg.open_scene(SEDAN, list(INPUTS[:2]))
    assert vg.open_scene(str(SEDAN), "000", np.eye(4).tolist()).names == ["000.png"]
    images, masks, cameras, depths = ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths
    cut_out = [
        np.dstack([image, np.where(mask, 255, 0).astype(np.uint8)]) for image, mask in zip(images, masks, strict=True)
    ]
    vg.reconstruct(np.stack(cut_out), None, cameras, check=False, max_views=1)
    doubles = [depth.astype(np.float64) for depth in depths]
    again = vg.reconstruct(
        images,
        [mask.astype(np.uint8) * 255 for mask in masks],
        cameras,
        [*doubles[:3], None],
        prior="hull",
        calibrate="off",
        symmetry="always",
        relight="never",
        keep=["overlap", "sh-bands"],
        vehicle_size=[4.4, 1.8, 1.4],
        cloud=made.gaussians.means.astype(np.float64),
        refine_backend="cpu",
        names=("a", "b", "c", "d"),
        check=False,
        progress=lambda stage, fraction: None,
    )
    assert_type(again.gaussians, vg.Gaussians)
    vg.reconstruct(iter(images), iter(masks), iter(cameras), iter(depths), keep="all", check=False)
    width, height = np.array([10, 20])
    camera = vg.Camera.from_matrix([[9, 0, 5], [0, 9, 10], [0, 0, 1]], np.eye(4), width, height)
    camera = vg.Camera.from_colmap(1, camera.width, camera.height, camera.params.tolist(), np.eye(4)[:3])
    assert {camera: 1}[camera] == 1 and camera.model == "PINHOLE"
    gaussians = vg.Gaussians.from_arrays([[0.0, 0, 3]], np.ones((1, 3)), [[1, 0, 0, 0]], [0.5], np.zeros((1, 1, 3)))
    planes = gaussians.render_planes(camera, depth_mode="accumulated", backend="cpu")
    gaussians.render_backward(camera, planes.color, depth=planes.depth.astype(np.float64), depth_mode="accumulated")
    gaussians.save_ply(tmp_path / "a.ply")
    assert vg.picture_errors(scene.images[0], scene.images[1]).psnr_db > 0
    assert vg.surface_errors(made.gaussians, made.gaussians.means.tolist()).f_score > 0
    fit = vg.align_points(np.eye(3), [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert_type(fit.residual_px, float | None)


def test_the_same_passes_through_ctypes(ellipsoid: Views) -> None:
    context = capi.Context(threads=1)
    made = capi.reconstruct(
        ellipsoid.images,
        ellipsoid.masks,
        ellipsoid.cameras,
        [depth.astype(np.float64) for depth in ellipsoid.depths],
        keep=["floaters"],
        vehicle_size=np.array([4.4, 1.8, 1.4]),
        check=False,
        context=context,
    )
    camera = capi.camera_from_colmap("PINHOLE", 20, 10, [9, 9, 10, 5], np.eye(4))
    assert_type(made.gaussians.render(camera), npt.NDArray[Any])
    assert_type(made.gaussians.render_planes(ellipsoid.cameras[0], (1, 0, 0), depth_mode="accumulated"), vg.Planes)
    assert capi.surface_errors(made.gaussians, made.gaussians.means.tolist()).f_score > 0


def test_words_that_are_none_fail(made: vg.Reconstruction, ellipsoid: Views) -> None:
    car, camera = made.gaussians, ellipsoid.cameras[0]
    images, masks, cameras = ellipsoid.images, ellipsoid.masks, ellipsoid.cameras
    with pytest.raises(ValueError, match="prior"):
        vg.reconstruct(images, masks, cameras, prior="hul")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="calibrate"):
        vg.reconstruct(images, masks, cameras, calibrate="on")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="symmetry"):
        vg.reconstruct(images, masks, cameras, symmetry="yes")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="relight"):
        vg.reconstruct(images, masks, cameras, relight="always")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="keep"):
        vg.reconstruct(images, masks, cameras, keep=["roof"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="refine_backend"):
        vg.reconstruct(images, masks, cameras, refine_seconds=1, refine_backend="cuda")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="depth_mode"):
        car.render_planes(camera, depth_mode="median")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="background"):
        car.render_planes(camera, "pink")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="backend"):
        vg.Renderer(car, "cuda")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="heading"):
        vg.align_folder(SEDAN, heading="sideways")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="heading"):
        capi.align_folder(SEDAN, heading="sideways")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="images"):
        vg.reconstruct([image / 255 for image in images], masks, cameras)  # type: ignore[misc]
    with pytest.raises(TypeError, match="depths"):
        millimetres = [(1000 * depth).astype(np.uint16) for depth in ellipsoid.depths]
        vg.reconstruct(images, masks, cameras, millimetres)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="threads"):
        car.render(camera, threads=1.5)  # type: ignore[call-overload]
