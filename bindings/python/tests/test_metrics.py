"""Measures: equal numbers in both interfaces, None where undefined, and errors for input that cannot be measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import Views
from vehicle_gaussians import Status, capi

FACES = [vg, capi]


def ball(face: Any, ellipsoid: Views) -> Any:
    views = [ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths]
    return face.reconstruct(*views).gaussians


def noisy(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    noise = np.random.default_rng(1).integers(-20, 21, picture.shape)
    return (picture + noise).clip(0, 255).astype(np.uint8)


def test_both_faces_measure_the_same(ellipsoid: Views) -> None:
    a, b = ellipsoid.images[0], noisy(ellipsoid.images[0])
    assert vg.picture_errors(a, b) == capi.picture_errors(a, b)
    view = (a, ellipsoid.masks[0], ellipsoid.cameras[0], ellipsoid.depths[0])
    models = [ball(face, ellipsoid) for face in FACES]
    seen = [face.view_errors(model, *view) for face, model in zip(FACES, models, strict=True)]
    assert seen[0] == seen[1] and seen[0].silhouette_iou > 0.85 and seen[0].depth_mae_m < 0.1
    scan = np.ascontiguousarray(models[0].means)
    surface = [face.surface_errors(model, scan) for face, model in zip(FACES, models, strict=True)]
    assert surface[0] == surface[1] and surface[0].accuracy_m < 0.1
    assert surface[0].chamfer_m == (surface[0].accuracy_m + surface[0].completeness_m) / 2


@pytest.mark.parametrize("face", FACES)
def test_pictures_are_measured_as_the_formulas_say(face: Any, ellipsoid: Views) -> None:
    a, b = ellipsoid.images[0], noisy(ellipsoid.images[0])
    mse = np.mean((a / 255.0 - b / 255.0) ** 2)
    errors = face.picture_errors(a, b)
    assert errors.psnr_db == pytest.approx(-10 * math.log10(mse), abs=1e-5)
    assert 0 < errors.ssim < 1 and errors.lpips is None
    assert face.picture_errors(a, a) == (math.inf, 1.0, None)
    assert face.picture_errors(a[:10], b[:10]).ssim is None
    floats = [(p / 255.0).astype(np.float32) for p in (a, b)]
    assert face.picture_errors(*floats) == pytest.approx(errors[:2] + (None,), abs=1e-6)
    # One half transparent, one half black, on white.
    gray = np.full((*a.shape[:2], 3), 128, np.uint8)
    black = np.zeros((*a.shape[:2], 4), np.uint8)
    black[..., 3] = 127
    assert face.picture_errors(gray, black).psnr_db > 80


@pytest.mark.parametrize("face", FACES)
def test_pictures_of_another_range_are_refused_or_measured_in_theirs(face: Any, ellipsoid: Views) -> None:
    a, b = ellipsoid.images[0], noisy(ellipsoid.images[0])
    expected = face.picture_errors(a, b)
    floats = [picture.astype(np.float32) for picture in (a, b)]
    words = r"^a(\[0, 0\]|, column 0, row 0): .*255.*; allowed: 0 to 1, and at most 1 beyond"
    with pytest.raises(ValueError, match=words):
        face.picture_errors(*floats)
    with pytest.raises(ValueError, match="^b"):
        face.picture_errors(floats[0] / 255, np.where(floats[1] > 250, np.float32(-1.5), floats[1] / 255))
    assert face.picture_errors(*floats, data_range=255) == pytest.approx(expected[:2] + (None,), abs=1e-6)
    assert face.picture_errors(a, b, data_range=255.0) == pytest.approx(expected[:2] + (None,), abs=1e-6)
    # White that overshoots is white.
    over = [np.where(picture == 255, np.float32(1.5), picture / np.float32(255)) for picture in floats]
    assert face.picture_errors(*over).psnr_db == pytest.approx(expected.psnr_db, abs=1e-4)
    for bad in (0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="^data_range: "):
            face.picture_errors(a, b, data_range=bad)


@pytest.mark.parametrize("face", FACES)
def test_what_a_view_does_not_have_is_none(face: Any, ellipsoid: Views) -> None:
    model = ball(face, ellipsoid)
    errors = face.view_errors(model, ellipsoid.images[0], None, ellipsoid.cameras[0])
    assert errors.depth_mae_m is None and errors.depth_p90_m is None and errors.lpips is None
    empty = np.zeros_like(ellipsoid.masks[0])
    assert face.view_errors(model, ellipsoid.images[0], empty, ellipsoid.cameras[0]).psnr_box_db is None


@pytest.mark.parametrize("face", FACES)
def test_what_cannot_be_measured_is_named(face: Any, ellipsoid: Views) -> None:
    model, image = ball(face, ellipsoid), ellipsoid.images[0]
    scan = np.zeros((5, 3), np.float32)
    broken = scan.copy()
    broken[2, 1] = np.nan
    for call, words in [
        (lambda: face.picture_errors(image, image[1:]), r"^b: 96x71; allowed: the size of a, 96x72"),
        (lambda: face.picture_errors(image[..., :2], image), r"^a: shape \(72, 96, 2\)"),
        (lambda: face.surface_errors(model, scan[:0]), r"^(scan|points|point_count): 0"),
        (lambda: face.surface_errors(model, broken), r"^(scan|points)\[2\]: "),
        (lambda: face.surface_errors(model, scan[:, :2]), r"^points: shape \(5, 2\); allowed: \(n, 3\)"),
        (lambda: face.surface_errors(model, scan, f_score=0.0), r"^(options\.)?f_score(_m)?: 0"),
        (lambda: face.view_errors(model, image[1:], None, ellipsoid.cameras[0]), r"^(view\.)?image: "),
    ]:
        with pytest.raises(vg.VgError, match=words) as caught:
            call()
        assert caught.value.code is Status.ARGUMENT
    with pytest.raises(TypeError, match="^points: array of int64; allowed: an array of floats, metres"):
        face.surface_errors(model, scan.astype(np.int64))
    assert face.surface_errors(model, scan.astype(np.float64)) == face.surface_errors(model, scan)
    with pytest.raises(TypeError, match="lpips|model"):
        face.picture_errors(image, image, lpips="m.onnx")
