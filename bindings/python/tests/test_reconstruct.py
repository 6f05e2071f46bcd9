"""Reconstruction from photographs in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from PIL import Image

import vehicle_gaussians as vg
from vehicle_gaussians import capi
from conftest import AXES, UNSEEN, Views, on_white, psnr, same_bytes


def test_the_unseen_side_of_the_sample_looks_like_its_photographs(
    sedan_made: vg.Reconstruction, sedan: vg.Scene, unseen: vg.Scene
) -> None:
    def mean_psnr(gaussians: vg.Gaussians) -> float:
        views = zip(unseen.cameras, unseen.images, unseen.masks, strict=True)
        return float(np.mean([psnr(gaussians.render(c), on_white(i, m)) for c, i, m in views]))

    # 24.3 dB with the scene's depth, 24.6 dB from silhouettes with the shape prior.
    assert len(unseen.images) == len(UNSEEN)
    assert mean_psnr(sedan_made.gaussians) > 24.0
    shape = vg.reconstruct(sedan.images, sedan.masks, sedan.cameras)
    assert shape.report["prior"] == "shape"
    assert mean_psnr(shape.gaussians) > 24.2


def test_the_report_is_a_dict_with_the_names_of_the_views(sedan_made: vg.Reconstruction) -> None:
    report = sedan_made.report
    assert report["version"] == vg.__version__
    assert report["prior"] == "given"
    assert report["views_used"] == ["000.png", "001.png", "002.png", "003.png"]
    assert report["gaussians"] == len(sedan_made.gaussians)
    assert report["input_error"]["psnr_db"] > 25
    assert [stage["name"] for stage in report["stages"]][-1] == "check"


def test_a_verdict_that_is_not_good_warns_in_both_faces(ellipsoid: Views) -> None:
    def shrunk(camera: vg.Camera) -> vg.Camera:
        pose = camera.vehicle_from_camera.copy()
        pose[:3, 3] *= 0.18
        return vg.Camera.from_matrix(camera.K, pose, camera.width, camera.height)

    cameras = [shrunk(camera) for camera in ellipsoid.cameras]
    reports = []
    for face in (vg, capi):
        with pytest.warns(vg.VgWarning, match=r"^bad: the vehicle is 0\.7.*metres") as caught:
            reports.append(face.reconstruct(ellipsoid.images, ellipsoid.masks, cameras, prior="hull").report)
        assert all(warning.filename == __file__ for warning in caught)
    for report in reports:
        assert report["verdict"] == "bad"
        assert "too-small" in [reason["code"] for reason in report["verdict_reasons"]]
        assert [view["name"] for view in report["input_views"]] == ["000", "001", "002", "003"]
        assert report["input_error_by_given_cameras"] == report["input_error"]


def test_points_are_metric_and_coloured_and_only_made_when_asked_for(ellipsoid: Views, made: vg.Reconstruction) -> None:
    assert made.points is None
    again = vg.reconstruct(
        ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths, points=True, check=False
    )
    assert again.points is not None and again.report["input_error"] is None
    positions, colors = again.points
    assert positions.shape == colors.shape == (sum(m.sum() for m in ellipsoid.masks), 3)
    assert (positions.dtype, colors.dtype) == (np.float32, np.uint8)
    # Every point lies on the ellipsoid, to the rounding of f32 depth.
    radius = np.linalg.norm(positions / np.array([2.2, 0.9, 0.7]), axis=1)
    np.testing.assert_allclose(radius, 1.0, atol=1e-4)
    assert again.points.colors is colors


def test_any_number_of_threads_gives_the_same_bytes(sedan: vg.Scene) -> None:
    one, two = (vg.reconstruct(sedan.images, sedan.masks, sedan.cameras, threads=n) for n in (1, 2))
    assert same_bytes(one.gaussians, two.gaussians)
    pictures = [one.gaussians.render(sedan.cameras[0], threads=n) for n in (1, 2)]
    assert pictures[0].tobytes() == pictures[1].tobytes()


@pytest.mark.parametrize("kind", ["reversed", "padded", "fortran", "one array", "generator", "Pillow"])
def test_arrays_of_any_layout_give_the_same_bytes(kind: str, ellipsoid: Views, made: vg.Reconstruction) -> None:
    images: Any = ellipsoid.images
    if kind == "reversed":
        images = [np.ascontiguousarray(image[::-1, ::-1, ::-1])[::-1, ::-1, ::-1] for image in images]
        assert all(min(image.strides) < 0 for image in images)
    elif kind == "padded":
        height, width = images[0].shape[:2]
        images = [np.pad(image, ((0, 3), (0, 5), (0, 0)))[:height, :width] for image in images]
        assert not images[0].flags.c_contiguous
    elif kind == "fortran":
        images = [np.asfortranarray(image) for image in images]
    elif kind == "one array":
        images = np.stack(images)
    elif kind == "generator":
        images = (image for image in ellipsoid.images)
    elif kind == "Pillow":
        images = [Image.fromarray(image) for image in images]
    unaligned = [np.frombuffer(b"." + d.tobytes(), np.uint8)[1:].view(np.float32) for d in ellipsoid.depths]
    depths = [flat.reshape(d.shape) for flat, d in zip(unaligned, ellipsoid.depths, strict=True)]
    again = vg.reconstruct(images, ellipsoid.masks, ellipsoid.cameras, depths)
    assert same_bytes(again.gaussians, made.gaussians)


@pytest.mark.filterwarnings("ignore:(bad|doubtful):vehicle_gaussians.VgWarning")
def test_masks_may_be_bool_or_bytes_or_the_alpha_channel(ellipsoid: Views, made: vg.Reconstruction) -> None:
    as_bytes = [np.where(mask, np.uint8(128), np.uint8(127)) for mask in ellipsoid.masks]
    given = vg.reconstruct(ellipsoid.images, as_bytes, ellipsoid.cameras, ellipsoid.depths)
    assert same_bytes(given.gaussians, made.gaussians)
    cut_out = [np.dstack([i, m]) for i, m in zip(ellipsoid.images, as_bytes, strict=True)]
    assert cut_out[0].shape[2] == 4
    for masks in (None, [None] * 4):
        from_alpha = vg.reconstruct(cut_out, masks, ellipsoid.cameras, ellipsoid.depths)
        assert same_bytes(from_alpha.gaussians, made.gaussians)
    # A given mask takes precedence over the alpha channel.
    everything = [np.ones_like(mask) for mask in ellipsoid.masks]
    masked = vg.reconstruct(cut_out, everything, ellipsoid.cameras, ellipsoid.depths, symmetry="never")
    plain = vg.reconstruct(ellipsoid.images, everything, ellipsoid.cameras, ellipsoid.depths, symmetry="never")
    assert same_bytes(masked.gaussians, plain.gaussians)


def test_a_mask_of_zeros_and_ones_is_read_as_one(ellipsoid: Views, made: vg.Reconstruction) -> None:
    ones = [mask.astype(np.uint8) for mask in ellipsoid.masks]
    again = vg.reconstruct(ellipsoid.images, ones, ellipsoid.cameras, ellipsoid.depths)
    assert same_bytes(again.gaussians, made.gaussians)
    twos = [2 * mask for mask in ones]
    with pytest.raises(vg.VgError, match=r"^masks\[0\]: largest value 2; allowed: 0 and 255, where 128 and above"):
        vg.reconstruct(ellipsoid.images, twos, ellipsoid.cameras, ellipsoid.depths)


def test_options_reach_the_library(ellipsoid: Views) -> None:
    made = vg.reconstruct(
        ellipsoid.images,
        ellipsoid.masks,
        ellipsoid.cameras,
        ellipsoid.depths,
        prior="hull",
        symmetry="never",
        vehicle_size=(4.4, 1.8, 1.4),
        vehicle_place=(0, 0, 0, 0),
        sh_degree=1,
        keep=["silhouette-edge", "sh-bands"],
        check=False,
        calibrate="off",
        relight="never",
        photo=False,
        budget=1e6,
        resolution=0.5,
        max_views=2,
        max_gaussians=600,
        refine_seconds=0.01,
        threads=1,
    )
    settings = made.report["settings"]
    assert (settings["prior"], settings["symmetry"]) == ("hull", "never")
    assert settings["vehicle_size"] == [4.4, 1.8, 1.4]
    assert settings["vehicle_place"] == {"center": [0, 0, 0], "yaw": 0}
    assert made.report["working_box"]["contradicted_m"] == 0
    assert {name for name, kept in settings["keep"].items() if kept} == {"silhouette_edge", "sh_bands"}
    assert made.gaussians.sh_degree == 1 and made.report["threads"] == 1
    assert not settings["check"] and not settings["photo"]
    assert (settings["calibrate"], settings["relight"]) == ("off", "never")
    assert made.report["plan"]["budget_s"] == 1e6
    assert (settings["resolution"], settings["max_views"]) == (0.5, 2)
    assert settings["max_gaussians"] == 600 and 0 < len(made.gaussians) <= 600
    assert len(made.report["views_used"]) == 2
    assert made.report["refinement"]["iterations"] >= 4
    assert made.report["calibration"] is None and made.report["relight"] is None


@pytest.mark.parametrize("face", [vg, capi])
def test_a_box_may_bring_its_place_by_either_face(face: Any, ellipsoid: Views) -> None:
    views = (ellipsoid.images[:1], ellipsoid.masks[:1], ellipsoid.cameras[:1])
    made = face.reconstruct(*views, prior="hull", check=False, vehicle_size=(4.4, 1.8, 1.4), vehicle_place=(0, 0, 0, 0))
    vehicle = made.report["vehicle"]
    for found, true, error in zip(vehicle["size_m"], (4.4, 1.8, 1.4), vehicle["uncertainty_m"], strict=True):
        # A single view.
        assert abs(found - true) < 3 * error
    with pytest.raises(vg.VgError, match="yaw.*radians"):
        face.reconstruct(*views, vehicle_size=(4.4, 1.8, 1.4), vehicle_place=(0, 0, 0, 90))
    with pytest.raises(vg.VgError, match="vehicle_size: .*; allowed: length, width, height"):
        face.reconstruct(*views, vehicle_place=(0, 0, 0, 0))


def test_a_cloud_in_the_vehicle_frame_pulls_the_surface_to_it(ellipsoid: Views) -> None:
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    given = vg.reconstruct(*views, ellipsoid.depths, points=True, check=False)
    assert given.points is not None
    cloud = given.points.positions[::20]
    assert np.linalg.norm(cloud / AXES, axis=1) == pytest.approx(1, abs=1e-4)
    made = vg.reconstruct(*views, prior="hull", cloud=cloud, check=False)
    fit = made.report["cloud"]
    assert fit["used"] + fit["outside"] <= len(cloud) and fit["used"] > 0.9 * len(cloud)
    assert fit["after_m"] <= fit["before_m"]
    # Any layout; the caller's array is not changed.
    before = cloud.copy()
    again = vg.reconstruct(*views, prior="hull", cloud=np.asfortranarray(cloud), check=False)
    assert same_bytes(made.gaussians, again.gaussians) and (cloud == before).all()
    # An empty array is no cloud.
    for none in (None, np.zeros((0, 3), np.float32)):
        assert vg.reconstruct(*views, prior="hull", cloud=none, check=False).report["cloud"] is None


def test_every_word_of_keep_sets_its_own_flag(ellipsoid: Views) -> None:
    words = ("duplicate-views", "overlap", "silhouette-edge", "floaters", "sh-bands")
    views = (ellipsoid.images[:1], ellipsoid.masks[:1], ellipsoid.cameras[:1], ellipsoid.depths[:1])
    for word in words:
        kept = vg.reconstruct(*views, keep=word, check=False).report["settings"]["keep"]
        assert [name for name, flag in kept.items() if flag] == [word.replace("-", "_")]
    kept = vg.reconstruct(*views, keep="all", check=False).report["settings"]["keep"]
    assert len(kept) == len(words) and all(kept.values())
