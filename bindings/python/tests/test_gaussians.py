"""Gaussians: arrays, pictures, files."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import Views, looking_at_the_origin, psnr, same_bytes

ARRAYS = ("means", "scales", "quats", "opacities", "sh")


def test_arrays_have_the_documented_shapes_and_units(made: vg.Reconstruction) -> None:
    g = made.gaussians
    n = len(g)
    assert n > 1000 and g.sh_degree == 2
    shapes = [getattr(g, name).shape for name in ARRAYS]
    assert shapes == [(n, 3), (n, 3), (n, 4), (n,), (n, 9, 3)]
    assert all(getattr(g, name).dtype == np.float32 for name in ARRAYS)
    np.testing.assert_allclose(np.linalg.norm(g.quats, axis=1), 1.0, atol=1e-6)
    assert g.scales.min() > 0 and 0 <= g.opacities.min() and g.opacities.max() <= 1
    assert g.bounds is not None
    np.testing.assert_array_equal(g.bounds, [g.means.min(0), g.means.max(0)])
    np.testing.assert_allclose(g.bounds[1], [2.2, 0.9, 0.7], atol=0.1)
    assert repr(g) == f"Gaussians({n}, sh_degree=2)"


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_read_only_views_that_are_not_copied(name: str, made: vg.Reconstruction) -> None:
    first, second = getattr(made.gaussians, name), getattr(made.gaussians, name)
    assert first.ctypes.data == second.ctypes.data and not first.flags.owndata
    assert first.base.base is made.gaussians
    with pytest.raises(ValueError, match="read-only"):
        first[...] = 0
    with pytest.raises(ValueError, match="cannot set WRITEABLE"):
        first.flags.writeable = True
    with pytest.raises(ValueError, match="cannot set WRITEABLE"):
        first[1:].flags.writeable = True


def test_an_array_outlives_the_object_it_came_from(ellipsoid: Views) -> None:
    made = vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths, check=False)
    views = {name: getattr(made.gaussians, name) for name in ARRAYS}
    copies = {name: view.copy() for name, view in views.items()}
    tail = made.gaussians.means[-1]
    expected = tail.copy()
    owner = made.gaussians
    assert sys.getrefcount(owner) > len(ARRAYS)
    del made, owner
    gc.collect()
    # Memory that was freed by mistake would be reused here.
    junk = [np.full_like(copy, 7.0) for copy in copies.values() for _ in range(4)]
    for name, view in views.items():
        np.testing.assert_array_equal(view, copies[name])
    views.clear()
    gc.collect()
    junk += [np.full(100_000, 9.0)]
    np.testing.assert_array_equal(tail, expected)


def test_the_last_array_frees_the_memory() -> None:
    def resident_bytes() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")

    if not Path("/proc/self/statm").exists():
        pytest.skip("needs Linux's account of memory")
    n, runs = 100_000, 40
    for run in range(runs):
        if run == 5:
            before = resident_bytes()
        g = from_random(n, degree=3)
        sh = g.sh
        del g
        assert sh.shape == (n, 16, 3)
        del sh
    one = n * (3 + 3 + 4 + 1 + 48) * 4
    assert resident_bytes() - before < 4 * one


def from_random(n: int, degree: int = 1, seed: int = 1) -> vg.Gaussians:
    random = np.random.default_rng(seed)
    return vg.Gaussians.from_arrays(
        random.normal(size=(n, 3)).astype(np.float32),
        random.uniform(0.01, 0.1, size=(n, 3)).astype(np.float32),
        random.normal(size=(n, 4)).astype(np.float32),
        random.uniform(size=n).astype(np.float32),
        random.normal(scale=0.2, size=(n, (degree + 1) ** 2, 3)).astype(np.float32),
    )


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_arrays_come_back_as_they_went_in_with_unit_quaternions(degree: int) -> None:
    random = np.random.default_rng(3)
    means = random.normal(size=(5, 3)).astype(np.float32)
    quats = random.normal(size=(5, 4)).astype(np.float32)
    sh = random.normal(size=(5, (degree + 1) ** 2, 3)).astype(np.float32)
    g = vg.Gaussians.from_arrays(means[::-1], np.ones((5, 3), np.float32), quats, np.ones(5, np.float32), sh)
    np.testing.assert_array_equal(g.means, means[::-1])
    np.testing.assert_array_equal(g.sh, sh)
    np.testing.assert_allclose(g.quats, quats / np.linalg.norm(quats, axis=1, keepdims=True), atol=1e-7)
    assert g.sh_degree == degree


def test_no_gaussians_are_gaussians_too(made: vg.Reconstruction, ellipsoid: Views) -> None:
    empty = from_random(0)
    assert len(empty) == 0 and empty.bounds is None and empty.sh.shape == (0, 4, 3)
    assert (empty.render(ellipsoid.cameras[0]) == 255).all()


def test_mirroring_flips_y_and_twice_is_nothing(made: vg.Reconstruction) -> None:
    once = made.gaussians.mirrored()
    np.testing.assert_array_equal(once.means, made.gaussians.means * np.array([1, -1, 1], np.float32))
    np.testing.assert_array_equal(once.quats, made.gaussians.quats * np.array([1, -1, 1, -1], np.float32))
    assert same_bytes(once.mirrored(), made.gaussians)


def test_moved_gaussians_look_the_same_to_the_moved_camera(made: vg.Reconstruction, ellipsoid: Views) -> None:
    world_from_vehicle = looking_at_the_origin((50.0, 40.0, 10.0))
    world_from_vehicle[:3, :3] *= 2.0
    moved = made.gaussians.transformed(world_from_vehicle)
    camera = ellipsoid.cameras[0]
    pose = camera.vehicle_from_camera
    world_from_camera = world_from_vehicle @ pose
    world_from_camera[:3, :3] /= 2.0
    # Twice as large, twice as far: the same picture, to the rounding of means at 50 m.
    assert psnr(moved.render(camera.with_pose(world_from_camera)), made.gaussians.render(camera)) > 55
    np.testing.assert_allclose(moved.scales, 2 * made.gaussians.scales, rtol=1e-6)
    assert same_bytes(made.gaussians.transformed(np.eye(4)), made.gaussians)


def test_merged_gaussians_are_the_ones_and_then_the_others() -> None:
    few, many = from_random(3, degree=0), from_random(5, degree=2)
    both = few.merged(many)
    assert (len(both), both.sh_degree) == (8, 2)
    np.testing.assert_array_equal(both.means, np.concatenate([few.means, many.means]))
    np.testing.assert_array_equal(both.sh[:3, :1], few.sh)
    assert not both.sh[:3, 1:].any()
    np.testing.assert_array_equal(both.sh[3:], many.sh)


def test_a_ply_file_holds_the_gaussians(made: vg.Reconstruction, ellipsoid: Views, tmp_path: Path) -> None:
    for path in (tmp_path / "a.ply", str(tmp_path / "b.ply")):
        made.gaussians.save_ply(path)
        read = vg.Gaussians.load_ply(path)
        np.testing.assert_array_equal(read.means, made.gaussians.means)
        np.testing.assert_array_equal(read.sh, made.gaussians.sh)
        # Stored as logarithm and logit.
        np.testing.assert_allclose(read.scales, made.gaussians.scales, rtol=1e-5)
        np.testing.assert_allclose(read.opacities, made.gaussians.opacities, atol=1e-6)


def test_a_picture_is_what_was_photographed(made: vg.Reconstruction, ellipsoid: Views) -> None:
    picture = made.gaussians.render(ellipsoid.cameras[0])
    assert (picture.shape, picture.dtype) == (ellipsoid.images[0].shape, np.uint8)
    assert picture.flags.owndata or picture.flags.writeable
    assert psnr(picture, ellipsoid.images[0]) > 25


def test_backgrounds(made: vg.Reconstruction, ellipsoid: Views) -> None:
    render, camera = made.gaussians.render, ellipsoid.cameras[0]
    np.testing.assert_array_equal(render(camera), render(camera, "white"))
    np.testing.assert_array_equal(render(camera, "black"), render(camera, (0, 0, 0)))
    assert tuple(render(camera, background=(0.0, 1.0, 0.2))[0, 0]) == (0, 255, 51)
    clear = render(camera, "transparent")
    assert clear.shape == (72, 96, 4) and clear[0, 0, 3] == 0
    assert clear[36, 48, 3] > 250
    # Straight alpha: composited on white, it is the picture on white, to the rounding of 8 bits.
    alpha = clear[..., 3:] / 255
    on_white = clear[..., :3] * alpha + 255 * (1 - alpha)
    assert np.abs(on_white - render(camera)).max() <= 1.5


def test_float_pictures_are_the_byte_pictures_before_rounding(made: vg.Reconstruction, ellipsoid: Views) -> None:
    render, camera = made.gaussians.render, ellipsoid.cameras[0]
    for background in ("white", "transparent"):
        precise = render(camera, background, dtype=np.float32)
        assert precise.dtype == np.float32
        rounded = np.rint(np.clip(precise, 0, 1) * np.float32(255))
        assert np.abs(rounded - render(camera, background).astype(np.float32)).max() <= 1
    np.testing.assert_array_equal(render(camera, dtype="float32"), render(camera, dtype=np.dtype("f4")))


def test_depth_is_that_of_the_surface_in_metres(made: vg.Reconstruction, ellipsoid: Views) -> None:
    for dtype in ("uint8", "float32"):
        picture, depth = made.gaussians.render(ellipsoid.cameras[0], depth=True, dtype=dtype)
        assert picture.shape == (72, 96, 3) and picture.dtype == dtype
        assert depth.shape == (72, 96) and depth.dtype == np.float32
        np.testing.assert_array_equal(picture, made.gaussians.render(ellipsoid.cameras[0], dtype=dtype))
    # A pixel's footprint is 6 cm wide, and on a slanted surface spans more depth than that.
    inner = inside(ellipsoid.masks[0])
    assert np.abs(depth - ellipsoid.depths[0])[inner].mean() < 0.06
    assert depth[0, 0] == 0


def inside(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """The mask without its rim of three pixels."""
    for _ in range(3):
        m = mask
        mask = m & np.roll(m, 1, 0) & np.roll(m, -1, 0) & np.roll(m, 1, 1) & np.roll(m, -1, 1)
    return mask


def test_render_options_change_the_picture(made: vg.Reconstruction, ellipsoid: Views) -> None:
    render, camera = made.gaussians.render, ellipsoid.cameras[0]
    plain = render(camera)
    assert (render(camera, sh_degree=0) != plain).any()
    assert (render(camera, antialiased=True) != plain).any()
    assert (render(camera, near=100.0) == 255).all() and (render(camera, far=1.0) == 255).all()
    half = camera.scaled(48, 36)
    assert render(half).shape == (36, 48, 3)


def test_a_lens_bends_the_picture(made: vg.Reconstruction, ellipsoid: Views) -> None:
    pinhole = ellipsoid.cameras[0]
    # Barrel distortion shrinks off-centre parts, so the silhouette covers fewer pixels.
    bent = vg.Camera.from_matrix(pinhole.K, pinhole.vehicle_from_camera, 96, 72, distortion=[-0.8, 0.3, 0, 0])
    areas = [int((made.gaussians.render(c) != 255).any(axis=2).sum()) for c in (pinhole, bent)]
    assert 0.5 < areas[1] / areas[0] < 0.99


def test_a_renderer_draws_the_same_and_says_who_did(made: vg.Reconstruction, ellipsoid: Views) -> None:
    camera = ellipsoid.cameras[0]
    ready = vg.Renderer(made.gaussians, "cpu")
    assert ready.backend == "cpu" and "asked for" in ready.choice and "cpu" in repr(ready)
    for background in ("white", "transparent"):
        expected = made.gaussians.render(camera, background)
        np.testing.assert_array_equal(ready.render(camera, background), expected)
    several = ready.render_many(ellipsoid.cameras, threads=1)
    assert len(several) == len(ellipsoid.cameras) > 1 and ready.render_many([]) == []
    for camera, picture in zip(ellipsoid.cameras, several, strict=True):
        np.testing.assert_array_equal(picture, made.gaussians.render(camera))
    assert vg.Renderer(made.gaussians).backend in ("cpu", "gpu")
    with pytest.raises(vg.VgError, match='backend: "cuda"; allowed: auto, cpu, gpu'):
        vg.Renderer(made.gaussians, "cuda")  # type: ignore[arg-type]
    with pytest.raises(vg.VgError, match="gpu is not in this build|graphics processor"):
        raise_unless_gpu(made.gaussians)


def raise_unless_gpu(gaussians: vg.Gaussians) -> None:
    """Renders on a GPU, or returns the error that says why it cannot."""
    if vg.Renderer(gaussians, "gpu").backend == "gpu":
        raise vg.VgError(vg.Status.MISSING, "graphics processor: there is one")
