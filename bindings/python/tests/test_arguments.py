"""Errors are Python's own in both interfaces, and name the argument; unambiguous values are accepted."""

from __future__ import annotations

import copy
import errno
import os
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views, same_bytes
from vehicle_gaussians import Status, capi

FACES = [vg, capi]
K = [[50, 0, 32], [0, 50, 24], [0, 0, 1]]

CLASSES: list[tuple[Status, str, type[vg.VgError], type[Exception]]] = [
    (Status.ARGUMENT, "threads: -1", vg.ArgumentError, ValueError),
    (Status.FORMAT, "a.ply: header: none", vg.FormatError, ValueError),
    (Status.IO, "a.ply: No such file or directory (os error 2)", vg.FileMissingError, FileNotFoundError),
    (Status.IO, "a.ply: Permission denied (os error 13)", vg.FileForbiddenError, PermissionError),
    (Status.IO, "a.ply: No space left on device (os error 28)", vg.FileError, OSError),
    (Status.IO, "a.ply: unexpected end of file", vg.FileError, OSError),
    (Status.RECONSTRUCTION, "prior: nothing", vg.ReconstructionError, RuntimeError),
    (Status.CANCELLED, "cancelled during head", vg.CancelledError, vg.VgError),
    (Status.NOT_BUILT, "backend: gpu", vg.NotBuiltError, NotImplementedError),
    (Status.INTERNAL, "internal error: none", vg.InternalError, RuntimeError),
    (Status.MISSING, "driver: none", vg.MissingError, RuntimeError),
    (Status.THREADS, "threads: 1 of 2 were started", vg.ThreadsError, RuntimeError),
]


@pytest.mark.parametrize(("code", "message", "ours", "pythons"), CLASSES)
def test_every_status_has_a_class_that_is_pythons_too(
    code: Status, message: str, ours: type[vg.VgError], pythons: type[Exception]
) -> None:
    error = vg.VgError(code, message)
    assert type(error) is ours and isinstance(error, pythons) and isinstance(error, vg.VgError)
    for again in (error, pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert (type(again), again.code, str(again), again.args) == (ours, code, message, (message,))
    assert repr(error) == f"{ours.__name__}({message!r})"
    if isinstance(error, OSError):
        number = re.search(r"os error (\d+)", message)
        assert error.errno == (int(number.group(1)) if number else None)
    assert {code for code, *_ in CLASSES} == set(Status) - {Status.OK}


@pytest.mark.parametrize("face", FACES)
def test_files_that_are_not_there_or_broken_are_what_python_calls_them(face: Any, tmp_path: Path) -> None:
    for call in (
        lambda: face.Gaussians.load_ply(tmp_path / "no.ply"),
        lambda: face.open_scene(tmp_path / "no"),
        lambda: face.align_folder(SEDAN, tmp_path / "no.ply"),
        lambda: some(face).save_ply(tmp_path / "no" / "car.ply"),
    ):
        with pytest.raises(FileNotFoundError, match=r"no(\.ply)?") as caught:
            call()
        assert isinstance(caught.value, vg.VgError) and caught.value.code is Status.IO
        assert (caught.value.errno, caught.value.strerror) == (errno.ENOENT, os.strerror(errno.ENOENT))
        assert str(caught.value.filename).startswith(str(tmp_path / "no"))
    (tmp_path / "bad.ply").write_text("ply or not")
    with pytest.raises(ValueError, match=r"bad\.ply") as broken:
        face.Gaussians.load_ply(tmp_path / "bad.ply")
    assert isinstance(broken.value, vg.FormatError)
    if os.geteuid() != 0:
        (tmp_path / "bad.ply").chmod(0)
        with pytest.raises(PermissionError, match=r"bad\.ply"):
            face.Gaussians.load_ply(tmp_path / "bad.ply")


def some(face: Any, **changed: Any) -> Any:
    arrays: dict[str, Any] = {
        "means": np.zeros((2, 3)),
        "scales": np.ones((2, 3)),
        "quats": np.ones((2, 4)),
        "opacities": np.ones(2),
        "sh": np.zeros((2, 1, 3)),
    }
    return face.Gaussians.from_arrays(**{**arrays, **changed})


def camera(face: Any, width: Any = 64, height: Any = 48, params: Any = (50, 50, 32, 24), pose: Any = None) -> Any:
    pose = np.eye(4) if pose is None else pose
    if face is capi:
        return capi.camera_from_colmap("PINHOLE", width, height, params, pose)
    return vg.Camera.from_colmap("PINHOLE", width, height, params, pose)


def reconstructing(face: Any, ellipsoid: Views, **changed: Any) -> Callable[[], Any]:
    lists = {name: getattr(ellipsoid, name) for name in ("images", "masks", "cameras")}
    return lambda: face.reconstruct(**{**lists, **changed})


@pytest.mark.parametrize("face", FACES)
def test_a_number_that_does_not_fit_is_a_value_error_that_names_it(face: Any, ellipsoid: Views) -> None:
    a, g, view = ellipsoid.images[0], some(face), ellipsoid.cameras[0]
    cases: list[tuple[str, Callable[[], Any]]] = [
        ("images: none; allowed: at least one", lambda: face.reconstruct([], None, [])),
        ("width: -1; allowed: 1 to 8192", lambda: camera(face, width=-1)),
        ("height: 99999999999; allowed: 1 to 8192", lambda: camera(face, height=99999999999)),
        ("sh_degree: -1; allowed: 0 to 3", reconstructing(face, ellipsoid, sh_degree=-1)),
        ("sh_degree: 256; allowed: 0 to 3", reconstructing(face, ellipsoid, sh_degree=256)),
        ("max_views: -1; allowed: at least 1", reconstructing(face, ellipsoid, max_views=-1)),
        ("refine_iterations: -5; allowed: 1 to 1000000", reconstructing(face, ellipsoid, refine_iterations=-5)),
        ("vehicle_size: shape (2,); allowed: ", reconstructing(face, ellipsoid, vehicle_size=(4, 2))),
        ("vehicle_size: shape (", reconstructing(face, ellipsoid, vehicle_size=4.5)),
        ("background: shape (2,); allowed: ", lambda: g.render(view, (0, 1))),
        ("budget: -1; allowed: seconds above 0", reconstructing(face, ellipsoid, budget=-1)),
        ("resolution: 2; allowed: above 0, at most 1", reconstructing(face, ellipsoid, resolution=2)),
        ("vehicle_size: [4.0, 2.0, 1000.0]; allowed: ", reconstructing(face, ellipsoid, vehicle_size=(4, 2, 1000))),
        ("f_score: 0; allowed: ", lambda: face.surface_errors(g, np.ones((4, 3)), f_score=0)),
    ]
    if face is vg:
        for call in (
            lambda: g.render(view, threads=-1),
            lambda: g.render_planes(view, threads=-1),
            lambda: g.render_backward(view, alpha=np.zeros((72, 96)), threads=-1),
            lambda: vg.Renderer(g, "cpu").render(view, threads=-1),
            lambda: vg.Renderer(g, "cpu").render_many([view], threads=-1),
            lambda: vg.picture_errors(a, a, threads=-1),
            lambda: vg.view_errors(g, a, None, view, threads=-1),
            lambda: vg.surface_errors(g, np.ones((4, 3)), threads=-1),
            lambda: vg.align_scan(ellipsoid.masks, ellipsoid.cameras, np.ones((4, 3)), threads=-1),
            lambda: vg.align_folder(SEDAN, threads=-1),
            lambda: vg.Model("no.onnx", threads=-1),
            reconstructing(vg, ellipsoid, threads=-1),
        ):
            cases.append(("threads: -1; allowed: 0 (all cores) to 1024", call))
        cases.append(("x: -1; allowed: a column of the picture", lambda: view.cropped(-1, 0, 8, 8)))
        cases.append(("width: -8; allowed: 1 to 8192", lambda: view.scaled(-8, 8)))
    else:
        cases.append(("threads: -1; allowed: 0 (all cores) to 1024", lambda: capi.Context(-1)))
        cases.append(("threads: -1; allowed: 0 (all cores) to 1024", lambda: capi.Model("no.onnx", threads=-1)))
        cases.append(("keep: 64; allowed: bits of Keep", reconstructing(face, ellipsoid, keep=64)))
    for message, call in cases:
        with pytest.raises(ValueError, match="^" + re.escape(message)) as caught:
            call()
        assert isinstance(caught.value, vg.ArgumentError) and caught.value.code is Status.ARGUMENT, message


@pytest.mark.parametrize("face", FACES)
def test_an_object_of_the_wrong_kind_is_a_type_error_that_names_it(face: Any, ellipsoid: Views) -> None:
    g = some(face)
    other = some(vg if face is capi else capi)
    image, mask, view = ellipsoid.images[0], ellipsoid.masks[0], ellipsoid.cameras[0]
    as_list = "allowed: a list with an entry for each view"
    cases: list[tuple[str, Callable[[], Any]]] = [
        (f"images: one array, shape (72, 96, 3); {as_list}", reconstructing(face, ellipsoid, images=image)),
        (f"masks: one array, shape (72, 96); {as_list}", reconstructing(face, ellipsoid, masks=mask)),
        (f"depths: one array, shape (72, 96); {as_list}", reconstructing(face, ellipsoid, depths=ellipsoid.depths[0])),
        (f"images: str; {as_list}", reconstructing(face, ellipsoid, images="car.png")),
        (f"cameras: Camera; {as_list}", reconstructing(face, ellipsoid, cameras=view)),
        (f"names: str; {as_list}", reconstructing(face, ellipsoid, names="0123")),
        (f"masks: one array, shape (72, 96); {as_list}", lambda: face.align_scan(mask, [view], np.ones((4, 3)))),
        (f"cameras: Camera; {as_list}", lambda: face.align_scan([mask], view, np.ones((4, 3)))),
        ("images[1]: array of float32; allowed: a NumPy array of uint8", floating(face, ellipsoid, "images")),
        ("masks[1]: array of float32; allowed: a NumPy array of ", floating(face, ellipsoid, "masks")),
        ("cameras[1]: str; allowed: a", reconstructing(face, ellipsoid, cameras=[view, "b", view, view])),
        ("sh_degree: float; allowed: a whole number, 0 to 3", reconstructing(face, ellipsoid, sh_degree=2.0)),
        ("width: str; allowed: a whole number, 1 to 8192", lambda: camera(face, width="64")),
        ("params: str; allowed: ", lambda: camera(face, params="50")),
        ("vehicle_from_camera: str; allowed: ", lambda: camera(face, pose="identity")),
        ("qvec: str; allowed: ", lambda: face.pose_from_colmap("q", [0, 0, 0])),
        ("points: str; allowed: an array of floats, metres, (n, 3)", lambda: face.surface_errors(g, "lidar.ply")),
        ("means: array of int64; allowed: an array of floats", lambda: some(face, means=np.zeros((2, 3), int))),
        ("views: int; allowed: a list", lambda: face.open_scene(SEDAN, 3)),
    ]
    if face is capi:
        by_capi = "Gaussians; allowed: capi.Gaussians"
        cases += [
            (f"other: {by_capi}", lambda: g.merged(other)),
            (f"gaussians: {by_capi}", lambda: capi.Renderer(other)),
            (f"gaussians: {by_capi}", lambda: capi.surface_errors(other, np.ones((4, 3)))),
            ("context: int; allowed: a Context", lambda: g.render(view, context=2)),
            ("names[0]: int; allowed: text", reconstructing(capi, ellipsoid, names=[0, 1, 2, 3])),
            ("prior: int; allowed: auto, given", reconstructing(capi, ellipsoid, prior=1)),
            ("budget: str; allowed: a number", reconstructing(capi, ellipsoid, budget="soon")),
        ]
    for message, call in cases:
        with pytest.raises(TypeError, match="^" + re.escape(message)) as caught:
            call()
        assert isinstance(caught.value, vg.ArgumentTypeError) and caught.value.code is Status.ARGUMENT, message


def floating(face: Any, ellipsoid: Views, which: str) -> Callable[[], Any]:
    entries = [a.copy() for a in getattr(ellipsoid, which)]
    entries[1] = entries[1].astype(np.float32)
    return reconstructing(face, ellipsoid, **{which: entries})


@pytest.mark.parametrize("face", FACES)
def test_floats_of_any_precision_are_what_they_are_rounded_to(
    face: Any, ellipsoid: Views, made: vg.Reconstruction
) -> None:
    doubles = [depth.astype(np.float64) for depth in ellipsoid.depths]
    swapped = [depth.astype(">f4") for depth in ellipsoid.depths]
    for depths in (doubles, swapped):
        again = face.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, depths)
        assert same_bytes(again.gaussians, made.gaussians)
    g = made.gaussians
    arrays = [getattr(g, name) for name in ("means", "scales", "quats", "opacities", "sh")]
    of_doubles = face.Gaussians.from_arrays(*(array.astype(np.float64) for array in arrays))
    assert same_bytes(of_doubles, face.Gaussians.from_arrays(*arrays))
    # Whole numbers in a list are accepted, because they do not come from a file in another unit.
    listed = face.Gaussians.from_arrays([[0, 0, 1]], [[1, 1, 1]], [[1, 0, 0, 0]], [1], [[[0, 0, 0]]])
    assert len(listed) == 1
    cloud = np.ascontiguousarray(g.means[::50])
    clouds = [cloud, cloud.astype(np.float64), cloud.tolist()]
    one, two, three = (face.surface_errors(of_doubles, points) for points in clouds)
    assert one == two == three
    a = (ellipsoid.images[0] / 255).astype(np.float64)
    assert face.picture_errors(a, a.astype(np.float32)).psnr_db > 120


def test_words_of_keep_are_those_of_the_other_face(ellipsoid: Views) -> None:
    views = (ellipsoid.images[:1], ellipsoid.masks[:1], ellipsoid.cameras[:1], ellipsoid.depths[:1])
    keeps: list[Any] = ["all", ["floaters", "sh-bands"], capi.Keep.OVERLAP, 3, "duplicate-views"]
    sets = [31, 24, 2, 3, 1]
    for keep, bits in zip(keeps, sets, strict=True):
        kept = capi.reconstruct(*views, keep=keep, check=False).report["settings"]["keep"]
        names = [member.lower() for member, bit in capi.Keep.__members__.items() if bits & bit]
        assert sorted(name for name, flag in kept.items() if flag) == sorted(names)
    with pytest.raises(ValueError, match="^keep: 'roof'; allowed: duplicate-views, "):
        capi.reconstruct(*views, keep="roof")


@pytest.mark.parametrize("face", FACES)
def test_one_view_may_be_asked_for_by_its_name_alone(face: Any) -> None:
    assert face.open_scene(SEDAN, INPUTS[0]).names == ["000.png"]
