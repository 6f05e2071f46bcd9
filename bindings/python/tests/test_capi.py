"""The C interface through ctypes, compared with the header by a C compiler, and byte for byte with the module."""

from __future__ import annotations

import ctypes as ct
import gc
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views, looking_at_the_origin, same_bytes
from vehicle_gaussians import Status, capi

HEADER = (capi.include_path() / "vg.h").read_text()
STRUCTURES = [thing for name, thing in vars(capi).items() if name.startswith("vg_") and issubclass(thing, ct.Structure)]
ENUMERATIONS = {
    "vg_status": Status,
    "vg_format": capi.Format,
    "vg_camera_model": capi.CameraModel,
    "vg_prior": capi.Prior,
    "vg_provider": capi.Provider,
    "vg_prepack": capi.Prepack,
    "vg_calibrate": capi.Calibrate,
    "vg_symmetry": capi.Symmetry,
    "vg_relight": capi.Relight,
    "vg_refine_stop": capi.RefineStop,
    "vg_heading": capi.Heading,
    "vg_keep": capi.Keep,
    "vg_log_level": capi.LogLevel,
    "vg_calibration": capi.Calibration,
    "vg_verdict": capi.Verdict,
    "vg_backend": capi.Backend,
    "vg_background": capi.Background,
    "vg_alpha": capi.Alpha,
    "vg_depth_mode": capi.DepthMode,
}


def test_every_function_of_the_header_is_declared_with_as_many_arguments() -> None:
    declared = {}
    for text in HEADER.split("\nVG_API\n")[1:]:
        found = re.match(r"[^(]*?(vg_\w+)\s*\(([^;]*)\);", text)
        assert found is not None, text[:80]
        arguments = found.group(2).strip()
        declared[found.group(1)] = 0 if arguments == "void" else arguments.count(",") + 1
    assert declared == {name: len(arguments) for name, (_, arguments) in capi.PROTOTYPES.items()}
    assert len(declared) > 50


def test_every_enumerator_of_the_header_has_its_number() -> None:
    code = re.sub(r"/\*.*?\*/", "", HEADER, flags=re.DOTALL)
    found = {
        name: {m: int(v) for m, v in re.findall(r"(VG_\w+) = (\d+)", body)}
        for name, body in re.findall(r"^enum (vg_\w+)\n.*?\{(.*?)\};", code, flags=re.DOTALL | re.MULTILINE)
    }
    expected = {
        name: {f"{name.upper()}_{member.name}": int(member) for member in members}
        for name, members in ENUMERATIONS.items()
    }
    assert found == expected
    number = re.search(r"#define VG_ABI_VERSION (\d+)", HEADER)
    assert number is not None and int(number.group(1)) == capi.ABI_VERSION == capi.library.vg_abi_version()


def test_every_structure_of_the_header_is_declared() -> None:
    found = re.findall(r"^typedef struct (vg_\w+) \{", HEADER, flags=re.MULTILINE)
    assert sorted(found) == sorted(s.__name__ for s in STRUCTURES)


def test_structures_lie_in_memory_as_a_c_compiler_lays_them(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    lines, expected = [], []
    for structure in STRUCTURES:
        name = structure.__name__
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        expected.append(f"{name} {ct.sizeof(structure)}")
        for field, *_ in structure._fields_:
            place = getattr(structure, field)
            lines.append(
                f'printf("{name}.{field} %zu %zu\\n", offsetof({name}, {field}), sizeof((({name} *)0)->{field}));'
            )
            expected.append(f"{name}.{field} {place.offset} {place.size}")
    source = tmp_path / "layout.c"
    body = "\n".join(lines)
    source.write_text(f'#include <stdio.h>\n#include "vg.h"\nint main(void) {{\n{body}\nreturn 0;\n}}\n')
    program = tmp_path / "layout"
    subprocess.run([compiler, f"-I{capi.include_path()}", source, "-o", program], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert printed.splitlines() == expected


def test_version() -> None:
    assert capi.version() == vg.__version__


@pytest.mark.parametrize("depth", [True, False])
def test_ctypes_and_the_extension_module_give_the_same_bytes(depth: bool, sedan: vg.Scene) -> None:
    depths = sedan.depths if depth else None
    ours = vg.reconstruct(sedan.images, sedan.masks, sedan.cameras, depths, points=True, names=sedan.names)
    theirs = capi.reconstruct(sedan.images, sedan.masks, sedan.cameras, depths, points=True, names=sedan.names)
    assert same_bytes(ours.gaussians, theirs.gaussians)
    assert ours.points is not None and theirs.points is not None
    for a, b in zip(ours.points, theirs.points, strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype) and a.tobytes() == b.tobytes()

    def without_times(report: dict[str, Any]) -> dict[str, Any]:
        # The number of threads is a setting in the extension module and belongs to the context in C.
        settings = {k: v for k, v in report["settings"].items() if k != "threads"}
        changing = ("stages", "total_ms", "peak_rss_bytes", "settings")
        # Poses are passed to C as matrices, which are orthonormalised again: the last digit may differ.
        for view in report["calibration"]["views"]:
            view["vehicle_from_camera"] = [round(v, 12) for v in view["vehicle_from_camera"]]
        return {**settings, **{k: v for k, v in report.items() if k not in changing}}

    assert without_times(ours.report) == without_times(theirs.report)
    camera = sedan.cameras[1]
    for background in ("white", "transparent"):
        for dtype in (np.uint8, np.float32):
            picture, z = ours.gaussians.render(camera, background, depth=True, dtype=dtype)
            picture_c, z_c = theirs.gaussians.render_with_depth(camera, background, dtype=dtype)
            np.testing.assert_array_equal(picture, picture_c)
            np.testing.assert_array_equal(z, z_c)


def test_options_are_those_of_the_extension_module(ellipsoid: Views, made: vg.Reconstruction) -> None:
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    cloud = made.gaussians.means[made.gaussians.means[:, 1] < 0][::10]
    given: dict[str, Any] = {
        "prior": "shape",
        "calibrate": "off",
        "symmetry": "always",
        "relight": "never",
        "photo": False,
        "cloud": cloud,
        "check": False,
        "budget": 1e6,
        "resolution": 0.75,
        "max_views": 3,
        "max_gaussians": 5000,
        "refine_iterations": 3,
        "refine_hold_out": True,
        "refine_backend": "cpu",
    }
    ours, theirs = vg.reconstruct(*views, **given), capi.reconstruct(*views, **given)
    assert same_bytes(ours.gaussians, theirs.gaussians)
    assert ours.report["cloud"] == theirs.report["cloud"] and ours.report["cloud"]["used"] > 0
    same = ("prior", "calibrate", "symmetry", "relight", "photo", "check", "resolution", "max_views", "max_gaussians")
    for name in same:
        assert ours.report["settings"][name] == theirs.report["settings"][name] == given[name]
    refinement = ours.report["refinement"]
    assert refinement == theirs.report["refinement"] and refinement["iterations"] == 3
    assert refinement["held_out"]["view"] == "001"
    assert refinement["drawn_by"].startswith("cpu (") and refinement["drawn_by"].endswith("): asked for")
    # The settings are those that the budget chose; the budget itself is in the plan.
    assert ours.report["plan"]["budget_s"] == theirs.report["plan"]["budget_s"] == given["budget"]
    # An array in another memory order is copied; an empty array is no cloud.
    given["cloud"] = np.asfortranarray(cloud)
    assert same_bytes(capi.reconstruct(*views, **given).gaussians, ours.gaussians)
    given["cloud"] = cloud[:0]
    assert capi.reconstruct(*views, **given).report["cloud"] is None


def test_scenes_opened_through_ctypes_give_the_same_bytes(
    sedan: vg.Scene, sedan_made: vg.Reconstruction, tmp_path: Path
) -> None:
    scene = capi.open_scene(SEDAN, INPUTS)
    assert scene.names == sedan.names
    for i in range(4):
        np.testing.assert_array_equal(scene.images[i], sedan.images[i])
        np.testing.assert_array_equal(scene.masks[i] == 255, sedan.masks[i])
        np.testing.assert_array_equal(scene.depths[i], sedan.depths[i])
    made = capi.reconstruct(scene.images, scene.masks, scene.cameras, scene.depths)
    assert same_bytes(made.gaussians, sedan_made.gaussians)
    image = scene.images[0]
    before = image.copy()
    del scene
    gc.collect()
    np.testing.assert_array_equal(image, before)
    assert not image.flags.writeable

    for part in ("images", "masks", "sparse"):
        shutil.copytree(SEDAN / part, tmp_path / part)
    with pytest.raises(vg.VgError, match="vehicle_from_world") as caught:
        capi.open_scene(tmp_path)
    assert caught.value.code is Status.FORMAT
    vehicle_from_world = np.eye(4)
    assert len(capi.open_scene(tmp_path, vehicle_from_world=vehicle_from_world).images) == 8


def test_what_gaussians_do_they_do_here_too(made: vg.Reconstruction, tmp_path: Path) -> None:
    ours = made.gaussians
    theirs = capi.Gaussians.from_arrays(ours.means, ours.scales, ours.quats, ours.opacities, ours.sh)
    assert same_bytes(ours, theirs)
    matrix = looking_at_the_origin((3.0, 2.0, 1.0))
    assert same_bytes(ours.mirrored(), theirs.mirrored())
    assert same_bytes(ours.transformed(matrix), theirs.transformed(matrix))
    assert same_bytes(ours.merged(ours), theirs.merged(theirs))
    ours.save_ply(tmp_path / "a.ply")
    theirs.save_ply(tmp_path / "b.ply")
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
    read = capi.Gaussians.load_ply(tmp_path / "a.ply")
    assert same_bytes(vg.Gaussians.load_ply(tmp_path / "a.ply"), read)
    assert repr(read) == f"Gaussians({len(ours)}, sh_degree=2)"


def test_arrays_are_read_only_and_outlive_the_gaussians(ellipsoid: Views) -> None:
    made = capi.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths)
    means, sh = made.gaussians.means, made.gaussians.sh
    assert means.ctypes.data == made.gaussians.means.ctypes.data
    expected = means.copy(), sh.copy()
    with pytest.raises(ValueError, match="read-only"):
        means[0] = 0
    with pytest.raises(ValueError, match="cannot set WRITEABLE"):
        means.flags.writeable = True
    del made
    gc.collect()
    junk = [np.full_like(sh, 7.0) for _ in range(8)]
    np.testing.assert_array_equal(means, expected[0])
    np.testing.assert_array_equal(sh, expected[1])
    assert len(junk) == 8


def test_handles_are_freed() -> None:
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("needs Linux's account of memory")

    def resident_bytes() -> int:
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGESIZE")

    n = 100_000
    arrays = [np.ones((n, k), np.float32) for k in (3, 3, 4)]
    for run in range(40):
        if run == 5:
            before = resident_bytes()
        g = capi.Gaussians.from_arrays(*arrays, np.ones(n, np.float32), np.zeros((n, 16, 3), np.float32))
        assert g.sh.shape == (n, 16, 3)
        del g
    assert resident_bytes() - before < 4 * n * 59 * 4


def test_padded_rows_are_read_in_place_and_other_layouts_are_copied(ellipsoid: Views, made: vg.Reconstruction) -> None:
    height, width = ellipsoid.images[0].shape[:2]
    padded = [np.pad(i, ((0, 2), (0, 5), (0, 0)))[:height, :width] for i in ellipsoid.images]
    flipped = [np.ascontiguousarray(m[::-1])[::-1] for m in ellipsoid.masks]
    depths = [np.asfortranarray(d) for d in ellipsoid.depths]
    alive: list[Any] = []
    lent = capi._lent(padded[0], capi.Format.RGB8, alive)
    assert lent.data == padded[0].ctypes.data and lent.row_stride == padded[0].strides[0] > 3 * width
    made_here = capi.reconstruct(padded, flipped, ellipsoid.cameras, depths)
    assert same_bytes(made_here.gaussians, made.gaussians)


def test_a_context_is_shared_between_calls_and_threads(ellipsoid: Views, made: vg.Reconstruction) -> None:
    context = capi.Context(threads=2)
    assert context.threads == 2
    car = capi.reconstruct(
        ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths, context=context
    ).gaussians
    expected = made.gaussians.render(ellipsoid.cameras[0])
    pictures: list[Any] = []
    callers = [
        threading.Thread(target=lambda: pictures.append(car.render(ellipsoid.cameras[0], context=context)))
        for _ in range(4)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(pictures) == 4 and all((p == expected).all() for p in pictures)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_is_told_of_its_parents_context_and_works_without_one(ellipsoid: Views) -> None:
    context = capi.Context(threads=2)
    made = capi.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths, context=context)
    car, camera = made.gaussians, ellipsoid.cameras[0]
    expected = car.render(camera)
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            car.render(camera, context=context)
        except vg.VgError as error:
            told = error.code is vg.Status.ARGUMENT and "is a fork" in str(error)
        else:
            told = False
        os._exit(0 if told and (car.render(camera) == expected).all() else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_progress_cancels_logs_and_passes_exceptions_through(ellipsoid: Views) -> None:
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    stages: list[str] = []
    lines: list[tuple[capi.LogLevel, str]] = []

    def cancel(stage: str, fraction: float) -> bool:
        stages.append(stage)
        return stage != "head"

    with pytest.raises(vg.VgError, match="cancelled during head") as caught:
        capi.reconstruct(*views, progress=cancel, log=lambda level, line: lines.append((level, line)))
    assert caught.value.code is Status.CANCELLED
    assert stages[0] == "plan" and stages[-1] == "head"

    def fail(stage: str, fraction: float) -> None:
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        capi.reconstruct(*views, progress=fail)
    capi.reconstruct(*views, log=lambda level, line: lines.append((level, line)))
    assert any(level is capi.LogLevel.INFO for level, _ in lines)


def test_ctrl_c_stops_a_reconstruction_through_ctypes() -> None:
    # A shell makes its background jobs ignore Ctrl-C.
    code = f"""
import signal
from vehicle_gaussians import capi
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = capi.open_scene({str(SEDAN)!r}, load_depth=False)
context = capi.Context(1)
print("ready", flush=True)
while True:
    capi.reconstruct(scene.images, scene.masks, scene.cameras, context=context)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with child:
        assert child.stdout is not None and child.stdout.readline() == "ready\n"
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.2)
        child.send_signal(signal.SIGINT)
        try:
            _, errors = child.communicate(timeout=30)
        finally:
            child.kill()
    assert child.returncode == -signal.SIGINT
    assert errors.strip().endswith("KeyboardInterrupt")


def test_poses_and_cameras_are_those_of_the_extension_module() -> None:
    pose = looking_at_the_origin((5.0, -4.0, 1.0))
    world = 2.0 * looking_at_the_origin((1.0, 2.0, 3.0))
    world[3] = [0, 0, 0, 1]
    q, t = [0.9, 0.1, -0.2, 0.3], [1.0, 2.0, 3.0]
    for similarity in (None, world):
        np.testing.assert_array_equal(capi.pose_from_colmap(q, t, similarity), vg.pose_from_colmap(q, t, similarity))
        np.testing.assert_array_equal(capi.pose_from_opengl(pose, similarity), vg.pose_from_opengl(pose, similarity))
    np.testing.assert_array_equal(
        capi.pose_from_box(world / 2 + np.diag([0, 0, 0, 0.5]), pose),
        vg.pose_from_box(world / 2 + np.diag([0, 0, 0, 0.5]), pose),
    )
    K = [[600, 0, 319.5], [0, 610, 239.5], [0, 0, 1]]
    bent = capi.camera_from_opencv(K, pose, 640, 480, [0.1, 0.2, 0.3, 0.4, 0.5])
    expected = vg.Camera.from_opencv(K, pose, 640, 480, [0.1, 0.2, 0.3, 0.4, 0.5])
    assert bent.model == capi.CameraModel[expected.model]
    np.testing.assert_array_equal(bent.params[: len(expected.params)], expected.params)
    fisheye = capi.camera_from_opencv(K, pose, 640, 480, [0.1] * 4, fisheye=True)
    assert fisheye.model == capi.CameraModel.OPENCV_FISHEYE
    part = capi.vg_camera()
    capi._call("vg_camera_crop", ct.byref(bent), 10, 20, 30, 40, ct.byref(part))
    assert (part.width, part.height, part.params[2]) == (30, 40, 310.0)
    capi._call("vg_camera_scale", ct.byref(bent), 320, 240, ct.byref(part))
    assert (part.width, part.params[0]) == (320, 300.0)
    point, pixel = np.zeros(3), np.zeros(2)
    capi._call("vg_camera_project", ct.byref(bent), point.ctypes.data, pixel.ctypes.data)
    np.testing.assert_allclose(pixel, [320, 240], atol=1e-9)


def test_figures_are_those_of_the_report(ellipsoid: Views) -> None:
    views = (capi.vg_view * 4)()
    alive: list[Any] = []
    for i in range(4):
        views[i] = capi._initial(capi.vg_view)
        views[i].camera = capi._camera(ellipsoid.cameras[i])
        views[i].image = capi._photograph(ellipsoid.images[i], "image", alive)
        views[i].mask = capi._mask(ellipsoid.masks[i], "mask", alive)
    car, report = ct.c_void_p(), ct.c_void_p()
    capi._call("vg_reconstruct", views, 4, None, ct.byref(car), ct.byref(report))
    figures = capi._initial(capi.vg_report_figures)
    capi._call("vg_report_get_figures", report, ct.byref(figures))
    assert figures.gaussian_count == capi.library.vg_gaussians_count(car)
    assert (figures.views_used, figures.prior, figures.has_input_error) == (4, capi.Prior.SHAPE, 1)
    assert 1.5 < figures.extent_high[1] - figures.extent_low[1] < 2.1
    told = json.loads(capi.library.vg_report_json(report))
    verdict = None if told["calibration"] is None else told["calibration"]["verdict"]
    names = {None: "NONE", "not-needed": "NOT_NEEDED", "accepted": "ACCEPTED", "refused": "REFUSED"}
    assert figures.calibration == capi.Calibration[names[verdict]]
    assert figures.has_uncovered == (told["masks"] is not None)
    assert figures.photo_found == (told["photo"] or {"found": 0})["found"]
    assert figures.relit_count == (told["relight"] or {"clones": 0})["clones"]
    assert figures.cloud_used == 0
    assert (figures.verdict, told["verdict"], figures.reason_count) == (capi.Verdict.GOOD, "good", 0)
    assert capi.library.vg_report_reason(report, 0) == b""
    by_given = told["input_error_by_given_cameras"]
    assert figures.input_given_psnr_db == pytest.approx(by_given["psnr_db"], rel=1e-12)
    assert figures.input_given_silhouette_iou == pytest.approx(by_given["silhouette_iou"], rel=1e-12)
    capi.library.vg_report_free(report)
    capi.library.vg_gaussians_free(car)


def test_errors_have_the_same_codes_and_texts(ellipsoid: Views, tmp_path: Path) -> None:
    with pytest.raises(vg.VgError, match="no.ply") as caught:
        capi.Gaussians.load_ply(tmp_path / "no.ply")
    assert caught.value.code is Status.IO
    for face, made in ((vg, vg.reconstruct), (capi, capi.reconstruct)):
        car = made(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths, check=False).gaussians
        with pytest.raises(vg.VgError, match="car.spz, the extension of SPZ.*ends in .ply") as caught:
            car.save_ply(tmp_path / "car.spz")
        assert caught.value.code is Status.ARGUMENT, face
    assert not (tmp_path / "car.spz").exists()
    with pytest.raises(TypeError, match=r"^images\[0\]: array of float32; allowed: a NumPy array of uint8"):
        capi.reconstruct([np.zeros((4, 4, 3), np.float32)], None, ellipsoid.cameras[:1])
    with pytest.raises(TypeError, match=r"^depths\[0\]: array of int64; allowed: an array of floats, metres"):
        capi.reconstruct(ellipsoid.images[:1], None, ellipsoid.cameras[:1], [np.zeros((72, 96), int)])
    with pytest.raises(TypeError, match=r"^cameras\[0\]: array of float64"):
        capi.reconstruct(ellipsoid.images[:1], None, [np.eye(4)])
    refused: list[tuple[dict[str, Any], str]] = [
        ({"prior": "best"}, "prior: 'best'; allowed: auto, given, hull, onnx, shape"),
        ({"calibrate": "yes"}, "calibrate: 'yes'; allowed: auto, off"),
        ({"relight": "yes"}, "relight: 'yes'; allowed: auto, never"),
        ({"photo": 2}, "photo: 2; allowed: 0 (no), 1 (yes)"),
        ({"budget": 0}, "budget: 0; allowed: seconds above 0"),
        ({"budget": -1}, "budget: -1"),
        ({"resolution": 0}, "resolution: 0; allowed: above 0, at most 1"),
        ({"max_views": 0}, "max_views: 0; allowed: at least 1"),
        ({"max_gaussians": 0}, "max_gaussians: 0; allowed: at least 1"),
        ({"refine_iterations": 0}, "refine_iterations: 0; allowed: 1 to 1000000"),
        ({"refine_iterations": 2_000_000}, "refine_iterations: 2000000; allowed: at most 1000000"),
        ({"refine_seconds": 0}, "refine_seconds: 0; allowed: above 0, at most 86400"),
        ({"refine_seconds": 2, "refine_iterations": 5}, "refine_seconds: 2, with refine_iterations 5"),
        ({"cloud": np.zeros((4, 2), np.float32)}, "cloud: shape (4, 2); allowed: (n, 3)"),
        ({"cloud": np.full((4, 3), np.nan, np.float32)}, "cloud[0]: [NaN, NaN, NaN]; allowed: finite"),
        ({"masks": []}, "masks: 0 entries; allowed: 4, one per image"),
        ({"sh_degree": 4}, "sh_degree: 4"),
        ({"masks": [np.zeros((5, 5), np.uint8)] * 4}, "masks[0]: 5x5"),
        ({"keep": 64}, "keep"),
    ]
    for options, message in refused:
        views: dict[str, Any] = {"images": ellipsoid.images, "masks": ellipsoid.masks, "cameras": ellipsoid.cameras}
        with pytest.raises(vg.VgError, match="^" + re.escape(message)) as caught:
            capi.reconstruct(**{**views, **options})
        assert caught.value.code is Status.ARGUMENT


def test_a_status_nobody_knows_yet_is_an_internal_error() -> None:
    assert vg.VgError(99, "from the future").code is Status.INTERNAL


def import_with(library: str | Path) -> str:
    ran = subprocess.run(
        [sys.executable, "-c", "import vehicle_gaussians.capi"],
        env={**os.environ, "VG_LIBRARY": str(library)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ran.returncode == 1
    return ran.stderr.strip().splitlines()[-1]


def test_a_library_that_is_missing_or_none_or_of_another_abi_is_an_import_error_with_hints(tmp_path: Path) -> None:
    said = import_with("/no/such/libvg.so")
    assert said.startswith("ImportError: /no/such/libvg.so: no such file. It is set by VG_LIBRARY. Hints: ")
    (tmp_path / "text.so").write_text("not a library")
    assert "cannot be loaded" in import_with(tmp_path / "text.so")
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")

    def library(name: str, source: str) -> Path:
        (tmp_path / f"{name}.c").write_text(source)
        subprocess.run([compiler, "-shared", "-fPIC", tmp_path / f"{name}.c", "-o", tmp_path / name], check=True)
        return tmp_path / name

    assert "not a libvg: it has no vg_abi_version" in import_with(library("other.so", "int other(void) { return 0; }"))
    future = library("future.so", "unsigned vg_abi_version(void) { return 7; }")
    assert "has binary interface 7; this module needs 0" in import_with(future)
    past = library("past.so", "unsigned vg_abi_version(void) { return 0; }")
    assert "older than this module: it has no vg_version, " in import_with(past)


def test_the_environment_variable_names_the_library(tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere.so"
    shutil.copyfile(capi.library_path(), copy)
    code = "from vehicle_gaussians import capi; print(capi.library_path(), capi.library._name, capi.version())"
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "VG_LIBRARY": str(copy)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert ran.stdout.split() == [str(copy), str(copy), vg.__version__]


def test_a_renderer_draws_several_pictures_of_one_call(made: vg.Reconstruction, ellipsoid: Views) -> None:
    g = made.gaussians
    copy = capi.Gaussians.from_arrays(g.means, g.scales, g.quats, g.opacities, g.sh)
    ready = capi.Renderer(copy, "cpu")
    cameras = [ellipsoid.cameras[0], ellipsoid.cameras[0]]
    expected = g.render(cameras[0])
    del copy
    gc.collect()
    assert ready.backend == "cpu" and "asked for" in ready.choice
    for picture in ready.render(cameras):
        np.testing.assert_array_equal(picture, expected)
    assert ready.render(cameras, "transparent").shape == (2, *expected.shape[:2], 4)
    with pytest.raises(vg.VgError, match="cameras: 0 of several sizes or none"):
        ready.render([])
