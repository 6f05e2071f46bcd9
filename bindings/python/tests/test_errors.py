"""Error messages: the argument, what was found, what is allowed."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import SEDAN, Views
from vehicle_gaussians import Status


def test_numbers_are_those_of_the_c_library() -> None:
    assert [(s.name, int(s)) for s in Status] == [
        ("OK", 0),
        ("ARGUMENT", 1),
        ("FORMAT", 2),
        ("IO", 3),
        ("RECONSTRUCTION", 4),
        ("CANCELLED", 5),
        ("NOT_BUILT", 6),
        ("INTERNAL", 7),
        ("MISSING", 8),
        ("THREADS", 9),
    ]


def test_an_error_survives_pickling() -> None:
    error = pickle.loads(pickle.dumps(vg.VgError(Status.IO, "a file")))
    assert (type(error), error.code, str(error)) == (vg.FileError, Status.IO, "a file")


WRONG_TYPES: dict[str, tuple[str, Any, str]] = {
    "float image": (
        "images",
        lambda a: a.astype(np.float32),
        "images[2]: array of float32; allowed: a NumPy array of uint8",
    ),
    "int image": ("images", lambda a: a.astype(np.int64), "images[2]: array of int64; allowed: a NumPy array of uint8"),
    "no image": ("images", lambda a: None, "images[2]: NoneType; allowed: a NumPy array of uint8"),
    "text": ("images", lambda a: "car.png", "images[2]: str; allowed: a NumPy array of uint8"),
    "ragged": ("images", lambda a: [[1], [1, 2]], "images[2]: list; allowed: a NumPy array of uint8"),
    "float mask": ("masks", lambda a: a.astype(float), "masks[2]: array of float64; allowed: a NumPy array of bool"),
    "millimetres": (
        "depths",
        lambda a: a.astype(np.uint16),
        "depths[2]: array of uint16; allowed: an array of floats, metres, (height, width); millimetres become one by",
    ),
    "no camera": ("cameras", lambda a: np.eye(4), "cameras[2]: ndarray; allowed: a Camera"),
}


@pytest.mark.parametrize("case", WRONG_TYPES)
def test_a_wrong_type_is_a_type_error_that_names_the_argument(case: str, ellipsoid: Views) -> None:
    which, change, message = WRONG_TYPES[case]
    lists: dict[str, list[Any]] = {
        name: list(getattr(ellipsoid, name)) for name in ("images", "masks", "depths", "cameras")
    }
    lists[which][2] = change(lists[which][2])
    with pytest.raises(TypeError, match="^" + re.escape(message)):
        vg.reconstruct(**lists)


WRONG_VALUES: dict[str, tuple[str, Any, str]] = {
    "grey image": (
        "images",
        lambda a: a[..., 0],
        "images[2]: shape (72, 96); allowed: (72, 96, 3) or (72, 96, 4), its camera's size",
    ),
    "turned image": ("images", lambda a: a.swapaxes(0, 1), "images[2]: shape (96, 72, 3); allowed: (72, 96, 3)"),
    "small mask": ("masks", lambda a: a[:10], "masks[2]: shape (10, 96); allowed: (72, 96), its camera's size"),
    "deep depth": (
        "depths",
        lambda a: a[..., None],
        "depths[2]: shape (72, 96, 1); allowed: (72, 96), its camera's size",
    ),
}


@pytest.mark.parametrize("case", WRONG_VALUES)
def test_a_wrong_shape_is_an_argument_error(case: str, ellipsoid: Views) -> None:
    which, change, message = WRONG_VALUES[case]
    lists: dict[str, list[Any]] = {
        name: list(getattr(ellipsoid, name)) for name in ("images", "masks", "depths", "cameras")
    }
    lists[which][2] = change(lists[which][2])
    with pytest.raises(vg.VgError, match="^" + re.escape(message)) as caught:
        vg.reconstruct(**lists)
    assert caught.value.code is Status.ARGUMENT


def test_lists_are_equally_long_and_not_empty(ellipsoid: Views) -> None:
    with pytest.raises(vg.VgError, match="^images: none; allowed: at least one"):
        vg.reconstruct([], None, [])
    with pytest.raises(vg.VgError, match="^masks: 3 entries; allowed: 4, one per image"):
        vg.reconstruct(ellipsoid.images, ellipsoid.masks[:3], ellipsoid.cameras)
    with pytest.raises(vg.VgError, match="^cameras: 1 entries"):
        vg.reconstruct(ellipsoid.images, None, ellipsoid.cameras[:1])
    with pytest.raises(vg.VgError, match="^names: 0 entries"):
        vg.reconstruct(ellipsoid.images, None, ellipsoid.cameras, names=[])


OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"prior": "best"}, 'prior: "best"; allowed: auto, given, hull, shape, onnx'),
    ({"calibrate": "yes"}, 'calibrate: "yes"; allowed: auto, off'),
    ({"relight": "always"}, 'relight: "always"; allowed: auto, never'),
    ({"budget": 0}, "budget: 0; allowed: seconds above 0"),
    ({"budget": -1.5}, "budget: -1.5; allowed: seconds above 0"),
    ({"budget": float("inf")}, "budget: inf; allowed: seconds above 0"),
    ({"resolution": 0.0}, "resolution: 0; allowed: above 0, at most 1"),
    ({"resolution": float("nan")}, "resolution: NaN; allowed: above 0, at most 1"),
    ({"max_views": 0}, "max_views: 0; allowed: at least 1"),
    ({"max_gaussians": 0}, "max_gaussians: 0; allowed: at least 1"),
    ({"refine_iterations": 0}, "refine_iterations: 0; allowed: 1 to 1000000"),
    ({"refine_iterations": 1_000_001}, "refine_iterations: 1000001; allowed: at most 1000000"),
    ({"refine_seconds": -1.0}, "refine_seconds: -1; allowed: above 0, at most 86400"),
    (
        {"refine_seconds": 1.0, "refine_iterations": 5},
        "refine_seconds: 1, with refine_iterations 5; allowed: only one of the two",
    ),
    ({"cloud": np.zeros((4, 2), np.float32)}, "cloud: shape (4, 2); allowed: (n, 3)"),
    ({"cloud": np.zeros(3, np.float32)}, "cloud: shape (3,); allowed: (n, 3)"),
    ({"cloud": np.array([[0, 0, 0], [0, np.inf, 0]], np.float32)}, "cloud[1]: [0.0, inf, 0.0]; allowed: finite"),
    ({"symmetry": "yes"}, 'symmetry: "yes"; allowed: auto, always, never, flip'),
    ({"keep": ["roof"]}, 'keep: "roof"; allowed: duplicate-views'),
    ({"sh_degree": 4}, "sh_degree: 4; allowed: 0 to 3"),
    (
        {"vehicle_size": (4, 2, 1000)},
        "vehicle_size: [4.0, 2.0, 1000.0]; allowed: length, width, height, each 0.1 to 30 m",
    ),
    ({"threads": 100_000}, "threads: 100000; allowed: 0 (all cores) to 1024"),
]


@pytest.mark.parametrize(("options", "message"), OPTIONS)
def test_a_wrong_option_is_named_as_in_the_call(options: dict[str, Any], message: str, ellipsoid: Views) -> None:
    with pytest.raises(vg.VgError, match="^" + re.escape(message)) as caught:
        vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, **options)
    assert caught.value.code is Status.ARGUMENT


def test_a_cloud_of_no_floats_is_a_type_error(ellipsoid: Views) -> None:
    for cloud, found in ((np.zeros((4, 3), int), "array of int64"), ([["0", "0", "0"]], "list"), ("lidar.ply", "str")):
        with pytest.raises(TypeError, match=f"^cloud: {found}; allowed: an array of floats, metres"):
            vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, cloud=cloud)  # type: ignore[arg-type]


def test_a_vehicle_that_cannot_be_made_says_why(ellipsoid: Views) -> None:
    nothing = [np.zeros_like(depth) for depth in ellipsoid.depths]
    with pytest.raises(vg.VgError) as caught:
        vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, nothing)
    assert caught.value.code is Status.RECONSTRUCTION and "depth" in str(caught.value)


def test_files_that_are_missing_or_broken(tmp_path: Path) -> None:
    with pytest.raises(vg.VgError, match="no.ply") as caught:
        vg.Gaussians.load_ply(tmp_path / "no.ply")
    assert caught.value.code is Status.IO
    (tmp_path / "bad.ply").write_text("ply or not")
    with pytest.raises(vg.VgError, match="bad.ply") as caught:
        vg.Gaussians.load_ply(tmp_path / "bad.ply")
    assert caught.value.code is Status.FORMAT
    (tmp_path / "car.spz").write_bytes(b"\x1f\x8b\x08\x00")
    with pytest.raises(vg.VgError, match="car.spz: format: this is SPZ.*allowed: PLY; convert it") as caught:
        vg.Gaussians.load_ply(tmp_path / "car.spz")
    assert caught.value.code is Status.FORMAT
    with pytest.raises(vg.VgError) as caught:
        vg.open_scene(tmp_path)
    assert caught.value.code is Status.FORMAT
    with pytest.raises(vg.VgError, match=r'views\[0\]: "nine"') as caught:
        vg.open_scene(SEDAN, ["nine"])
    assert caught.value.code is Status.ARGUMENT


def test_cameras_say_what_is_wrong_with_them() -> None:
    K, pose = np.diag([600.0, 600.0, 1.0]), np.eye(4)
    refused: list[tuple[Any, str]] = [
        (lambda: vg.Camera.from_matrix(np.eye(4), pose, 8, 8), "K: shape (4, 4); allowed: a 3x3 matrix"),
        (lambda: vg.Camera.from_matrix(K + np.eye(3, k=1), pose, 8, 8), "camera.k: ["),
        (lambda: vg.Camera.from_matrix(-K, pose, 8, 8), "camera.k: ["),
        (lambda: vg.Camera.from_matrix(K, pose * 2, 8, 8), "vehicle_from_camera: last row"),
        (lambda: vg.Camera.from_matrix(K, np.diag([1, -1, 1, 1]), 8, 8), "vehicle_from_camera: |R^T R - I|"),
        (lambda: vg.Camera.from_matrix(K, np.eye(3), 8, 8), "vehicle_from_camera: shape (3, 3); allowed: a 3x4 or 4x4"),
        (lambda: vg.Camera.from_matrix(K, pose, 0, 8), "camera.size: 0x8"),
        (
            lambda: vg.Camera.from_matrix(K, pose, 8, 8, [1, 2, 3]),
            "camera.distortion: 3 numbers; allowed: 0, 4, 5 or 8",
        ),
        (lambda: vg.Camera.from_colmap("FOV", 8, 8, [1], pose), "model: FOV; allowed: SIMPLE_PINHOLE (0)"),
        (lambda: vg.Camera.from_colmap(17, 8, 8, [1], pose), "model: 17; allowed"),
        (lambda: vg.Camera.from_colmap("PINHOLE", 8, 8, [1], pose), "camera.params: 1 numbers; allowed: 4 for PINHOLE"),
        (lambda: vg.pose_from_colmap([0, 0, 0, 0], [0, 0, 0]), "qvec: quaternion"),
        (lambda: vg.pose_from_colmap([1, 0, 0], [0, 0, 0]), "qvec: shape (3,); allowed: 4 numbers"),
        (lambda: vg.pose_from_opengl(np.diag([1, 1, -1, 1])), "camera_to_world: |R^T R - I|"),
        (lambda: vg.pose_from_opengl(pose, np.diag([1, 1, -1, 1])), "vehicle_from_world: det = -1"),
        (lambda: vg.similarity_from_points(np.eye(4), np.eye(4)), "source: shape (4, 4); allowed: an (n, 3) array"),
        (lambda: vg.Camera.from_matrix(K, pose, 8, 8).scaled(0, 1), "resized.size: 0x1"),
        (lambda: vg.Camera.from_matrix(K, pose, 8, 8).cropped(4, 4, 8, 1), "crop: 8x1 at column 4, row 4"),
        (lambda: vg.pose_from_box(pose, pose * 2), "ego_from_camera: last row"),
    ]
    for call, message in refused:
        with pytest.raises(vg.VgError, match="^" + re.escape(message)) as caught:
            call()
        assert caught.value.code is Status.ARGUMENT
    with pytest.raises(TypeError, match="^K: str; allowed: a 3x3 matrix"):
        vg.Camera.from_matrix("K", pose, 8, 8)
    with pytest.raises(TypeError, match="^model: float; allowed: COLMAP's name or number"):
        vg.Camera.from_colmap(1.5, 8, 8, [1], pose)


def test_gaussians_say_what_is_wrong_with_them(ellipsoid: Views) -> None:
    good: dict[str, Any] = {
        "means": np.zeros((2, 3), np.float32),
        "scales": np.ones((2, 3), np.float32),
        "quats": np.ones((2, 4), np.float32),
        "opacities": np.ones(2, np.float32),
        "sh": np.zeros((2, 1, 3), np.float32),
    }
    refused = {
        "means: shape (2, 2); allowed: (n, 3)": {"means": np.zeros((2, 2), np.float32)},
        "quats: 1 entries; allowed: 2 for 2 means": {"quats": np.ones((1, 4), np.float32)},
        "quats[0]: [0.0": {"quats": np.zeros((2, 4), np.float32)},
        "scales[0]: [0.0": {"scales": np.zeros((2, 3), np.float32)},
        "opacities[0]: 2; allowed: 0 to 1": {"opacities": np.full(2, 2, np.float32)},
        "opacities: shape (2, 1); allowed: (n,)": {"opacities": np.ones((2, 1), np.float32)},
        "sh: shape (2, 5, 3); allowed: (n, K, 3)": {"sh": np.zeros((2, 5, 3), np.float32)},
        "sh[1]: NaN": {"sh": np.array([0, 0, 0, 0, 0, np.nan], np.float32).reshape(2, 1, 3)},
    }
    for message, change in refused.items():
        with pytest.raises(vg.VgError, match="^" + re.escape(message)):
            vg.Gaussians.from_arrays(**{**good, **change})
    g = vg.Gaussians.from_arrays(**good)
    for message, matrix in {
        "to_from_vehicle: det": np.diag([1, -1, 1, 1]),
        "to_from_vehicle: shape (3, 4)": np.eye(4)[:3],
    }.items():
        with pytest.raises(vg.VgError, match="^" + re.escape(message)):
            g.transformed(matrix)
    with pytest.raises(TypeError, match="^means: array of int64; allowed: an array of floats"):
        vg.Gaussians.from_arrays(**{**good, "means": np.zeros((2, 3), int)})
    camera = ellipsoid.cameras[0]
    drawn: list[tuple[dict[str, Any], str]] = [
        ({"background": "pink"}, 'background: "pink"; allowed: white, black, transparent'),
        ({"background": (255, 0, 0)}, "background: 255; allowed: 0 to 1"),
        ({"background": (1, 0)}, "background: shape (2,); allowed: 3 numbers"),
        ({"near": -1.0}, "near: -1"),
        ({"threads": 5000}, "threads: 5000"),
    ]
    for options, message in drawn:
        with pytest.raises(vg.VgError, match="^" + re.escape(message)):
            g.render(camera, **options)
    with pytest.raises(TypeError, match="^dtype: float64; allowed: uint8 or float32"):
        g.render(camera, dtype=np.float64)
    with pytest.raises(TypeError, match="camera"):
        g.render(np.eye(4))


def test_a_panic_is_an_internal_error_and_prints_nothing() -> None:
    code = """
import vehicle_gaussians as vg
try:
    vg._native._panic_on_a_worker_thread()
except vg.VgError as error:
    assert error.code is vg.Status.INTERNAL, error.code
    assert str(error).startswith("internal error: made for a test (bindings/python/src"), error
else:
    raise SystemExit("no error")
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")
