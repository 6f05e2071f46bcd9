"""Daily work: cameras placed by hand, points to pixels, parts of Gaussians, refinement, tables, reports."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, REPOSITORY, SEDAN, Views, looking_at_the_origin
from vehicle_gaussians import capi
from vehicle_gaussians._report import schema

K = np.array([[600.0, 0, 319.5], [0, 610, 239.5], [0, 0, 1]])
RVEC, TVEC = np.array([0.3, -1.1, 0.7]), np.array([0.1, 0.2, 6.0])


def rodrigues(rvec: Any) -> Any:
    """The rotation of a vector, as OpenCV defines it."""
    angle = np.linalg.norm(rvec)
    x, y, z = rvec / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_a_camera_that_looks_at_a_point_has_it_in_the_middle_and_up_is_up() -> None:
    camera = vg.Camera.look_at((6, -4, 1.5), (0.2, 0.1, 0.7), 640, 480, fov_y_degrees=40)
    assert camera.vehicle_from_camera[:3, 3].tolist() == [6, -4, 1.5]
    middle, above = camera.project([(0.2, 0.1, 0.7), (0.2, 0.1, 0.9)])
    assert middle == pytest.approx([320, 240]) and above[0] == pytest.approx(320) and above[1] < 240
    assert 2 * np.degrees(np.arctan(240 / camera.K[1, 1])) == pytest.approx(40)
    lying = vg.Camera.look_at((6, -4, 1.5), (0.2, 0.1, 0.7), 640, 480, up=(0, 1, 0))
    assert not np.allclose(lying.vehicle_from_camera, camera.vehicle_from_camera)
    for bad, words in [
        (lambda: vg.Camera.look_at((0, 0, 1), (0, 0, 1), 640, 480), "^target: .* where the camera stands"),
        (lambda: vg.Camera.look_at((0, 0, 5), (0, 0, 1), 640, 480), "^up: .* along the line of sight"),
        (lambda: vg.Camera.look_at((1, 0, 5), (0, 0, 1), 640, 480, fov_y_degrees=180), "^fov_y_degrees: 180"),
        (lambda: vg.Camera.look_at((1, 0), (0, 0, 1), 640, 480), "^eye: shape"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            bad()


def test_points_go_to_pixels_and_back_through_any_lens(made: vg.Reconstruction) -> None:
    pose = looking_at_the_origin((6.0, -4.0, 0.8))
    points = made.gaussians.means.astype(float)
    for lens in (
        {},
        {"distortion": [-0.2, 0.05, 1e-3, -2e-3]},
        {"distortion": [0.02, -0.01, 0.003, 0], "fisheye": True},
    ):
        camera = vg.Camera.from_opencv(K, pose, 640, 480, **lens)
        pixels, depths = camera.project(points, depth=True)
        assert pixels.shape == (len(points), 2) and depths.shape == (len(points),)
        assert camera.project(points).tobytes() == pixels.tobytes()
        assert camera.unproject(pixels, depths) == pytest.approx(points, abs=1e-7)
    # Computed by hand, without distortion.
    camera = vg.Camera.from_opencv(K, pose, 640, 480)
    seen = (points - pose[:3, 3]) @ pose[:3, :3]
    assert camera.project(points) == pytest.approx(seen[:, :2] / seen[:, 2:] * [600, 610] + [320, 240])
    behind = camera.project([2 * pose[:3, 3], (np.nan, 0, 0)])
    assert np.isnan(behind).all()
    assert np.isnan(camera.unproject([(1, 2), (1, 2), (1, 2)], [0, -1, np.nan])).all()
    assert camera.project(np.empty((0, 3))).shape == (0, 2)
    with pytest.raises(vg.VgError, match=r"^points: shape \(2, 2\); allowed: an \(n, 3\) array"):
        camera.project([(1, 2), (3, 4)])
    with pytest.raises(vg.VgError, match=r"^depths: shape \(1,\); allowed: \(2,\), one for each pixel"):
        camera.unproject([(1, 2), (3, 4)], [1.0])


def test_a_pose_of_opencv_is_the_inverse_of_its_rotation_and_translation() -> None:
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3], camera_from_world[:3, 3] = rodrigues(RVEC), TVEC
    expected = np.linalg.inv(camera_from_world)
    # (3, 1) as cv2 returns them.
    for rvec, tvec in [(RVEC, TVEC), (RVEC[:, None], TVEC[:, None])]:
        assert vg.pose_from_opencv(rvec, tvec) == pytest.approx(expected, abs=1e-12)
        camera = vg.Camera.from_opencv(K, width=640, height=480, distortion=[-0.1, 0, 0, 0], rvec=rvec, tvec=tvec)
        assert camera.vehicle_from_camera == pytest.approx(expected, abs=1e-12)
        assert camera.model == "OPENCV" and camera.params == pytest.approx([600, 610, 320, 240, -0.1, 0, 0, 0])
    world = np.diag([0.5, 0.5, 0.5, 1.0])
    assert vg.pose_from_opencv(RVEC, TVEC, world)[:3, 3] == pytest.approx(0.5 * expected[:3, 3])
    for call, words in [
        (lambda: vg.Camera.from_opencv(K, np.eye(4), 640, 480, rvec=RVEC, tvec=TVEC), "more than one pose"),
        (lambda: vg.Camera.from_opencv(K, width=640, height=480, rvec=RVEC), "no whole pose"),
        (
            lambda: vg.Camera.from_opencv(K, width=640, height=480),
            "no whole pose; allowed: vehicle_from_camera, or rvec",
        ),
        (lambda: vg.pose_from_opencv([1, 2], TVEC), r"^rvec: shape \(2,\); allowed: 3 numbers"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            call()  # type: ignore[no-untyped-call]


def test_a_turntable_has_all_of_the_vehicle_in_every_picture(made: vg.Reconstruction) -> None:
    cameras = made.gaussians.turntable(8, 320, 240)
    assert len(cameras) == 8
    assert cameras[0].vehicle_from_camera[0, 3] > 3 and cameras[2].vehicle_from_camera[1, 3] > 3
    for camera in cameras:
        pixels = camera.project(made.gaussians.means)
        assert (pixels > 0).all() and (pixels < [320, 240]).all()
    with pytest.raises(vg.VgError, match="^turntable: no Gaussians"):
        made.gaussians[:0].turntable(8, 320, 240)
    with pytest.raises(vg.VgError, match="^count: 0"):
        made.gaussians.turntable(0, 320, 240)


def test_indices_of_numpy_select_what_they_select_of_arrays(made: vg.Reconstruction) -> None:
    car = made.gaussians
    some = np.array([5, 0, -1, 5])
    for index in (
        slice(None, None, 7),
        slice(10, 2, -3),
        some,
        [3, 4],
        car.opacities > 0.5,
        np.zeros(len(car), bool),
        [],
    ):
        part = car[index]  # type: ignore[index]
        rows = np.asarray(index, int) if isinstance(index, list) else index
        for name in ("means", "scales", "quats", "opacities", "sh"):
            assert getattr(part, name).tobytes() == np.asarray(getattr(car, name))[rows].tobytes(), name
    for index, words in [
        (3, r"^index: int; allowed: a slice, \d+ bools, or whole numbers; of one Gaussian \[i\]"),
        (np.array([0.5]), "^index: array of float64"),
        ([len(car)], r"^index\[0\]: \d+; allowed: -"),
        ([True], r"^index: 1 bools"),
        (np.zeros((2, 2), int), r"^index: shape \(2, 2\)"),
        ("all", "^index: str"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            car[index]
    # Not a sequence: NumPy does not convert it as nested lists.
    assert np.asarray(car, dtype=object).shape == ()


def test_a_box_crops_and_covariances_are_turned_squares(made: vg.Reconstruction) -> None:
    car = made.gaussians
    inf = np.inf
    front = car.cropped((0, -inf, -inf), (inf, inf, inf))
    assert front == car[car.means[:, 0] >= 0]
    with pytest.raises(vg.VgError, match=r"^low\[1\]: 1 with high\[1\] 0"):
        car.cropped((0, 1, 0), (1, 0, 1))
    w, x, y, z = car.quats.astype(float).T
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    half = rotation * car.scales[:, None, :]
    found = car.covariances()
    assert found.shape == (len(car), 3, 3) and found.dtype == np.float32
    assert np.allclose(found, half @ half.transpose(0, 2, 1), rtol=1e-6, atol=1e-8)


def test_ply_in_memory_is_ply_in_a_file(made: vg.Reconstruction, tmp_path: Path) -> None:
    made.gaussians.save_ply(tmp_path / "car.ply")
    data = made.gaussians.to_ply_bytes()
    assert data == (tmp_path / "car.ply").read_bytes()
    for held in (data, bytearray(data), memoryview(data)):
        assert vg.Gaussians.from_ply_bytes(held) == vg.Gaussians.load_ply(tmp_path / "car.ply")
    with pytest.raises(vg.FormatError):
        vg.Gaussians.from_ply_bytes(data[:-1])
    with pytest.raises(TypeError, match="^data: str; allowed: bytes"):
        vg.Gaussians.from_ply_bytes("ply")  # type: ignore[arg-type]


def test_refining_a_shaken_model_brings_it_closer_and_tells(ellipsoid: Views, made: vg.Reconstruction) -> None:
    scene = vg.Scene(ellipsoid.images, list(ellipsoid.masks), list(ellipsoid.depths), ellipsoid.cameras, list(INPUTS))
    car = made.gaussians
    shaken = vg.Gaussians.from_arrays(car.means, car.scales, car.quats, car.opacities, 0.8 * car.sh)
    told: list[tuple[str, float, float]] = []

    def progress(stage: str, fraction: float, overall: float) -> None:
        told.append((stage, fraction, overall))

    refined = vg.refine(shaken, scene, iterations=12, progress=progress)
    before, after = refined.report["psnr_db"]
    assert after > before + 0.5 and refined.report["kept"] > 0
    assert len(refined.gaussians) == len(shaken) and told[-1] == ("refine", 1.0, 1.0)
    means = [np.mean([row.psnr_db for row in vg.evaluate(model, scene)]) for model in (shaken, refined.gaussians)]
    assert means[1] > means[0] + 0.5
    with pytest.raises(vg.CancelledError, match="during refine"):
        vg.refine(shaken, scene, iterations=1000, progress=lambda stage, fraction: False)
    for call, words in [
        (lambda: vg.refine(shaken, scene, iterations=0), "^iterations: 0"),
        (lambda: vg.refine(shaken, scene, iterations=5, seconds=1.0), "^seconds: 1, with iterations 5"),
        (lambda: vg.refine(shaken, scene, seconds=-1.0), "^seconds: -1"),
        (lambda: vg.refine(shaken[:0], scene), "^gaussians: none"),
        (lambda: vg.refine(shaken, dataclasses.replace(scene, masks=scene.masks[1:])), "^masks: 3"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            call()


def test_a_folder_is_evaluated_to_rows_with_names(sedan: vg.Scene, sedan_made: vg.Reconstruction) -> None:
    told: list[float] = []
    rows = vg.evaluate(sedan_made.gaussians, SEDAN, INPUTS[:2], progress=lambda stage, fraction: told.append(fraction))
    assert rows == vg.evaluate(sedan_made.gaussians, vg.open_scene(SEDAN, INPUTS[:2])) and told == [0.5, 1.0]
    first = vg.view_errors(sedan_made.gaussians, sedan.images[0], sedan.masks[0], sedan.cameras[0], sedan.depths[0])
    assert rows[0] == (sedan.names[0], *first) and rows[0]._fields[1:] == first._fields
    with pytest.raises(vg.VgError, match="^views, vehicle_from_world: given with an open scene"):
        vg.evaluate(sedan_made.gaussians, sedan, INPUTS)


def test_the_committed_schema_is_that_of_the_typed_report_and_holds_real_reports(
    sedan_made: vg.Reconstruction, ellipsoid: Views
) -> None:
    path = REPOSITORY / "docs" / "report.schema.json"
    text = json.dumps(schema(), indent=2) + "\n"
    if os.environ.get("VG_BLESS"):
        path.write_text(text)
    assert path.read_text() == text, "VG_BLESS=1 writes it anew"
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    with pytest.warns(vg.VgWarning):
        with_budget = vg.reconstruct(*views, budget=1e-3)
    others = [
        vg.reconstruct(*views, refine_iterations=4, refine_hold_out=True),
        vg.reconstruct(*views, ellipsoid.depths, calibrate="off", symmetry="never", check=False),
        with_budget,
    ]
    validator = jsonschema.Draft202012Validator(schema())
    for made in (sedan_made, *others):
        validator.validate(made.report)
        report = vg.Report.of(made.report)
        assert dataclasses.asdict(report) == made.report
    typed = vg.Report.of(sedan_made.report)
    assert typed.input_error is not None and typed.input_error.psnr_db > 20
    assert typed.stages[0].name == "plan" and typed.gaussians == len(sedan_made.gaussians)
    assert vg.Report.of(others[0].report).refinement.held_out.view == "002"  # type: ignore[union-attr]
    assert vg.Report.of(with_budget.report).plan.fits is False  # type: ignore[union-attr]
    # A newer library may have more fields.
    assert vg.Report.of({**sedan_made.report, "new": 1}) == typed


def by_ctypes(gaussians: vg.Gaussians) -> capi.Gaussians:
    return capi.Gaussians.from_arrays(*(getattr(gaussians, name) for name in ARRAYS))


ARRAYS = ("means", "scales", "quats", "opacities", "sh")


def same(ours: capi.Gaussians, theirs: vg.Gaussians) -> bool:
    return all(getattr(ours, name).tobytes() == getattr(theirs, name).tobytes() for name in ARRAYS)


def test_cameras_and_pixels_of_the_ctypes_face_are_those_of_the_extension(made: vg.Reconstruction) -> None:
    theirs = vg.Camera.look_at((6, -4, 1.5), (0, 0, 0.7), 640, 480, fov_y_degrees=40, up=(0, 0.1, 1))
    ours = capi.camera_look_at((6, -4, 1.5), (0, 0, 0.7), 640, 480, fov_y_degrees=40, up=(0, 0.1, 1))
    assert np.array(ours.params)[:4].tolist() == theirs.params.tolist()
    assert np.array(ours.vehicle_from_camera).reshape(3, 4).tolist() == theirs.vehicle_from_camera[:3].tolist()
    points = made.gaussians.means.astype(float)
    pixels, depths = capi.project(ours, points, depth=True)
    # A pose that is passed in is orthonormalised again, which changes its last bits.
    for found in (pixels, capi.project(theirs, points)):
        assert found == pytest.approx(theirs.project(points), abs=1e-9)
    assert capi.unproject(ours, pixels, depths) == pytest.approx(theirs.unproject(pixels, depths), abs=1e-9)
    world = np.diag([0.5, 0.5, 0.5, 1.0])
    for rvec, tvec in [(RVEC, TVEC), (RVEC[:, None], TVEC[:, None])]:
        assert capi.pose_from_opencv(rvec, tvec, world).tobytes() == vg.pose_from_opencv(rvec, tvec, world).tobytes()
    by_vectors = capi.camera_from_opencv(K, width=640, height=480, rvec=RVEC, tvec=TVEC)
    expected = vg.Camera.from_opencv(K, width=640, height=480, rvec=RVEC, tvec=TVEC)
    assert np.array(by_vectors.vehicle_from_camera).reshape(3, 4) == pytest.approx(expected.vehicle_from_camera[:3])
    for call, words in [
        (lambda: capi.camera_look_at((0, 0, 1), (0, 0, 1), 640, 480), "^target: .* where the camera stands"),
        (lambda: capi.camera_from_opencv(K, width=640, height=480), "no whole pose"),
        (lambda: capi.project(ours, [(1, 2)]), r"^points: shape \(1, 2\); allowed: an \(n, 3\) array"),
        (lambda: capi.unproject(ours, [(1, 2)], [1, 2]), r"^depths: shape \(2,\)"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            call()  # type: ignore[no-untyped-call]


def test_parts_and_files_of_the_ctypes_face_are_those_of_the_extension(made: vg.Reconstruction) -> None:
    theirs = made.gaussians
    ours = by_ctypes(theirs)
    for index in (slice(None, None, 7), [5, 0, -1, 5], theirs.opacities > 0.5, []):
        assert same(ours[index], theirs[index])  # type: ignore[index]
    assert same(ours.cropped((0, -1, -1), (9, 9, 9)), theirs.cropped((0, -1, -1), (9, 9, 9)))
    assert ours.covariances().tobytes() == theirs.covariances().tobytes()
    assert ours.to_ply_bytes() == theirs.to_ply_bytes()
    assert same(capi.Gaussians.from_ply_bytes(ours.to_ply_bytes()), vg.Gaussians.from_ply_bytes(theirs.to_ply_bytes()))
    pairs = zip(ours.turntable(5, 64, 48), theirs.turntable(5, 64, 48), strict=True)
    for mine, camera in pairs:
        assert np.array(mine.vehicle_from_camera).reshape(3, 4).tolist() == camera.vehicle_from_camera[:3].tolist()
    for call, words in [
        (lambda: ours[3], "^index: int"),
        (lambda: ours.cropped((0, 1, 0), (1, 0, 1)), r"^low\[1\]: 1 with"),
        (lambda: ours.turntable(0, 64, 48), "^count: 0"),
        (lambda: capi.Gaussians.from_ply_bytes("ply"), "^data: str; allowed: bytes"),  # type: ignore[arg-type]
        (lambda: list(ours), "not iterable"),  # type: ignore[call-overload]
    ]:
        with pytest.raises((vg.VgError, TypeError), match=words):
            call()


def test_refinement_and_tables_of_the_ctypes_face_are_those_of_the_extension(
    ellipsoid: Views, made: vg.Reconstruction
) -> None:
    lists = (ellipsoid.images, list(ellipsoid.masks), list(ellipsoid.depths), ellipsoid.cameras, list(INPUTS))
    theirs = vg.refine(made.gaussians, vg.Scene(*lists), iterations=6, hold_out=True)
    scene = capi.Scene(*lists)
    ours = capi.refine(by_ctypes(made.gaussians), scene, iterations=6, hold_out=True)
    assert same(ours.gaussians, theirs.gaussians)
    for name in ("iterations", "made", "kept", "stop", "psnr_db"):
        assert ours.report[name] == theirs.report[name], name
    assert ours.report["held_out"]["psnr_db"] == theirs.report["held_out"]["psnr_db"]
    assert capi.evaluate(by_ctypes(made.gaussians), scene) == vg.evaluate(made.gaussians, vg.Scene(*lists))
    rows = capi.evaluate(by_ctypes(made.gaussians), SEDAN, INPUTS[:1])
    assert len(rows) == 1 and rows[0].name.startswith("000")
    for call, words in [
        (lambda: capi.refine(ours.gaussians, scene, iterations=5, seconds=1.0), "^seconds: 1, with iterations 5"),
        (lambda: capi.refine(ours.gaussians, scene, seconds=-1.0), "^seconds: -1"),
        (lambda: capi.evaluate(ours.gaussians, scene, INPUTS), "^views, vehicle_from_world: given with an open scene"),
    ]:
        with pytest.raises(vg.VgError, match=words):
            call()
    with pytest.raises(vg.CancelledError):
        capi.refine(ours.gaussians, scene, progress=lambda stage, fraction: False)
