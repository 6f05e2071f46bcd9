"""Gradients in both interfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import Views, looking_at_the_origin
from vehicle_gaussians import Status, capi

N = 40


@pytest.fixture(scope="module")
def arrays() -> tuple[npt.NDArray[np.float32], ...]:
    random = np.random.default_rng(5)
    return (
        random.uniform(-1, 1, (N, 3)).astype(np.float32),
        random.uniform(0.05, 0.4, (N, 3)).astype(np.float32),
        random.normal(size=(N, 4)).astype(np.float32),
        random.uniform(0.1, 0.95, N).astype(np.float32),
        random.normal(0, 0.3, (N, 4, 3)).astype(np.float32),
    )


@pytest.fixture(scope="module")
def camera() -> vg.Camera:
    K = [[40, 0, 20], [0, 40, 15], [0, 0, 1]]
    return vg.Camera.from_matrix(K, looking_at_the_origin((4.0, -3.0, 1.0)), 40, 30)


@pytest.fixture(scope="module")
def planes() -> vg.Planes:
    random = np.random.default_rng(6)
    return vg.Planes(*(random.normal(size=s).astype(np.float32) for s in ((30, 40, 3), (30, 40), (30, 40))))


@pytest.mark.parametrize("background", ["white", "transparent", (0.2, 0.5, 0.9)])
@pytest.mark.parametrize("depth_mode", ["expected", "accumulated"])
def test_both_faces_give_the_same_bytes(
    arrays: Any, camera: vg.Camera, planes: vg.Planes, background: Any, depth_mode: Any
) -> None:
    ours, theirs = vg.Gaussians.from_arrays(*arrays), capi.Gaussians.from_arrays(*arrays)
    drawn = ours.render_planes(camera, background, depth_mode=depth_mode)
    again = theirs.render_planes(camera, background, depth_mode=depth_mode)
    made = ours.render_backward(camera, *planes, background, depth_mode=depth_mode)
    same = theirs.render_backward(camera, *planes, background, depth_mode=depth_mode)
    for (name, mine), other in zip([*drawn._asdict().items(), *made._asdict().items()], [*again, *same], strict=True):
        assert mine.shape == other.shape and mine.dtype == other.dtype, name
        if mine.dtype == np.float32:
            assert mine.tobytes() == other.tobytes(), name
        else:
            # The camera is passed as a matrix and converted to a quaternion again: the last bits may differ.
            np.testing.assert_allclose(mine, other, rtol=1e-11, atol=1e-11 * np.abs(mine).max(), err_msg=name)
        assert np.isfinite(mine).all() and (mine.any() or (name, background) == ("background", "transparent")), name
    for name in ("means", "scales", "quats", "opacities", "sh"):
        assert getattr(made, name).shape == getattr(ours, name).shape
    assert (made.background.shape, made.pose.shape, made.view_matrix.shape) == ((3,), (6,), (4, 4))


def test_planes_are_the_picture(made: vg.Reconstruction, ellipsoid: Views) -> None:
    g, camera = made.gaussians, ellipsoid.cameras[0]
    picture, depth = g.render(camera, dtype="float32", depth=True)
    planes = g.render_planes(camera)
    np.testing.assert_array_equal(planes.color, picture)
    np.testing.assert_array_equal(planes.depth, depth)
    clear = g.render(camera, "transparent", dtype="float32")
    premultiplied = g.render_planes(camera, "transparent")
    np.testing.assert_array_equal(planes.alpha, clear[..., 3])
    np.testing.assert_allclose(premultiplied.color, clear[..., :3] * clear[..., 3:], atol=1e-6)
    accumulated = g.render_planes(camera, depth_mode="accumulated")
    np.testing.assert_allclose(accumulated.depth, depth * planes.alpha, rtol=1e-5, atol=1e-6)


def test_gradients_tell_how_the_loss_changes(arrays: Any, camera: vg.Camera, planes: vg.Planes) -> None:
    # Inputs that enter linearly: exact except for rounding. Clamped colours make sh non-linear.
    g = vg.Gaussians.from_arrays(*arrays)
    made = g.render_backward(camera, *planes)

    def loss(background: Any) -> float:
        drawn = g.render_planes(camera, background)
        return sum(float((d.astype(float) * p).sum()) for d, p in zip(drawn, planes, strict=True))

    for channel in range(3):
        low, high = np.full(3, 0.25), np.full(3, 0.25)
        high[channel] = 0.75
        assert loss(high) - loss(low) == pytest.approx(0.5 * made.background[channel], rel=1e-3, abs=1e-3)
    # A loss of depth alone is a loss whose other planes are zero.
    alone = g.render_backward(camera, depth=planes.depth)
    zero = g.render_backward(camera, 0 * planes.color, 0 * planes.alpha, planes.depth)
    np.testing.assert_array_equal(alone.means, zero.means)
    assert not alone.sh.any() and made.sh.any()


def test_planes_of_any_layout_are_taken(arrays: Any, camera: vg.Camera, planes: vg.Planes) -> None:
    expected = vg.Gaussians.from_arrays(*arrays).render_backward(camera, *planes)
    padded = vg.Planes(*(np.pad(p, [(0, 2), (0, 3)] + [(0, 0)] * (p.ndim - 2))[:30, :40] for p in planes))
    flipped = vg.Planes(*(np.ascontiguousarray(p[::-1])[::-1] for p in planes))
    for face in (vg, capi):
        g = face.Gaussians.from_arrays(*arrays)
        for laid_out in (padded, flipped, vg.Planes(*(np.asfortranarray(p) for p in planes))):
            np.testing.assert_array_equal(g.render_backward(camera, *laid_out).means, expected.means)


def test_no_gaussians_have_gradients_too(arrays: Any, camera: vg.Camera, planes: vg.Planes) -> None:
    for face in (vg, capi):
        made = face.Gaussians.from_arrays(*(array[:0] for array in arrays)).render_backward(camera, *planes)
        assert made.means.shape == (0, 3) and made.sh.shape == (0, 4, 3)
        np.testing.assert_allclose(made.background, planes.color.sum((0, 1)), rtol=1e-5)


@pytest.mark.parametrize("face", [vg, capi])
def test_bad_planes_are_named(face: Any, arrays: Any, camera: vg.Camera, planes: vg.Planes) -> None:
    g = face.Gaussians.from_arrays(*arrays)
    with pytest.raises(TypeError, match="^alpha: array of int64; allowed: an array of floats"):
        g.render_backward(camera, alpha=planes.alpha.astype(int))
    for name, array in (("color", planes.color[:-1]), ("color", planes.alpha), ("depth", planes.color)):
        with pytest.raises(vg.VgError, match=rf"^{name}: shape \(.*\); allowed: \(30, 40") as caught:
            g.render_backward(camera, **{name: array})
        assert caught.value.code is Status.ARGUMENT
    with pytest.raises(vg.VgError, match="at least one of them"):
        g.render_backward(camera)
    with pytest.raises(vg.VgError, match="^depth_mode: .median.; allowed: expected, accumulated"):
        g.render_backward(camera, alpha=planes.alpha, depth_mode="median")
    with pytest.raises(vg.VgError, match="^depth_mode: "):
        g.render_planes(camera, depth_mode="median")
    for call in (g.render_planes, lambda c, **o: g.render_backward(c, alpha=planes.alpha, **o)):
        with pytest.raises(vg.VgError, match="^backend: .cuda.; allowed: auto, cpu, gpu"):
            call(camera, backend="cuda")
        # A wheel without GPU support raises an error.
        with pytest.raises(vg.VgError, match="backend: gpu is not in this build"):
            call(camera, backend="gpu")
    for name in ("color", "alpha", "depth"):
        spoiled = getattr(planes, name).copy()
        spoiled[7, 11, ...] = np.nan
        with pytest.raises(vg.VgError, match=rf"{name}\[7(\]\[|, )11\]: NaN; allowed: finite numbers"):
            g.render_backward(camera, **{name: spoiled})
