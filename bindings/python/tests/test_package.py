"""The package itself: versions, contents of the wheel, types."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

import vehicle_gaussians as vg
from conftest import REPOSITORY
from vehicle_gaussians import capi

PACKAGE = Path(vg.__file__).parent
BINDINGS = REPOSITORY / "bindings" / "python"


def test_the_version_is_that_of_the_library() -> None:
    library = tomllib.loads((REPOSITORY / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    assert vg.__version__ == metadata.version("vehicle-gaussians") == library


def test_the_package_holds_the_c_library_types_and_licences() -> None:
    assert (PACKAGE / "py.typed").is_file()
    assert [file.name for file in (PACKAGE / "lib").iterdir()] == [capi.library_path().name]
    assert (PACKAGE / "include" / "vg.h").read_bytes() == (REPOSITORY / "include" / "vg.h").read_bytes()
    files = {str(file) for file in metadata.files("vehicle-gaussians") or ()}
    for licence in ("LICENSE-MIT", "LICENSE-APACHE", "LICENSES-THIRD-PARTY"):
        assert any(file.endswith(f"licenses/{licence}") for file in files)


def test_a_source_distribution_is_refused_with_the_way_out(tmp_path: Path) -> None:
    code = f"import build_backend; build_backend.build_sdist({str(tmp_path)!r})"
    ran = subprocess.run([sys.executable, "-c", code], cwd=BINDINGS, capture_output=True, text=True, check=False)
    assert ran.returncode == 1 and "`pip wheel ./bindings/python`" in ran.stderr


@pytest.mark.parametrize("hook", ["build_wheel", "prepare_metadata_for_build_wheel", "prepare_metadata_for_build_editable"])
def test_a_build_without_rust_says_what_to_install(hook: str, tmp_path: Path) -> None:
    code = f"import build_backend; build_backend.{hook}({str(tmp_path)!r})"
    nowhere = {**os.environ, "PATH": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=BINDINGS, capture_output=True, text=True, check=False, env=nowhere
    )
    assert ran.returncode == 1 and "Install Rust 1.89 or newer" in ran.stderr and "Traceback" not in ran.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="sonames are ELF's")
def test_only_the_c_library_is_called_libvg() -> None:
    # Otherwise the loader would give the extension module to a program in the same process that needs libvg.so.0.
    native = Path(vg._native.__file__).read_bytes()
    assert b"libvg.so.0" not in native and b"libvg.so.0" in capi.library_path().read_bytes()


def test_ctypes_works_without_the_extension_module_and_the_rest_says_what_is_missing(tmp_path: Path) -> None:
    shutil.copytree(PACKAGE, tmp_path / "vehicle_gaussians", ignore=shutil.ignore_patterns("_native*", "__pycache__"))
    code = f"""
from vehicle_gaussians import capi
import vehicle_gaussians as vg
assert vg.__file__.startswith({str(tmp_path)!r}) and vg.__version__ == capi.version()
car = capi.Gaussians.from_arrays([[0.0, 0, 3]], [[1.0] * 3], [[1.0, 0, 0, 0]], [0.9], [[[1.0] * 3]])
camera = capi.camera_from_colmap("PINHOLE", 8, 8, [9, 9, 4, 4], [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]])
assert (car.render(camera) < 255).any()
assert not isinstance(car, vg.Gaussians) and not isinstance(car, vg.Camera)
calls = [
    lambda: vg.Camera.from_matrix([], [], 1, 1),
    lambda: vg.Gaussians.load_ply("car.ply"),
    lambda: vg.Renderer(car),
    lambda: vg.Model("m.onnx"),
    lambda: vg.open_scene("car"),
    lambda: vg.reconstruct([], None, []),
    lambda: vg.align_points([], []),
    lambda: vg.picture_errors(1, 2),
    lambda: vg.pose_from_box(1, 2),
]
for call in calls:
    try:
        call()
    except ImportError as error:
        assert "needs the extension module" in str(error) and "vehicle_gaussians.capi" in str(error), error
    else:
        raise SystemExit("no error")
"""
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("readelf") is None, reason="readelf reads ELF")
def test_both_libraries_stay_in_memory_when_they_are_unloaded() -> None:
    # A thread that called one of them runs its destructors when it ends, which may be later.
    for library in (Path(vg._native.__file__), capi.library_path()):
        read = subprocess.run(["readelf", "-d", "-W", str(library)], capture_output=True, text=True, check=True)
        assert any("(FLAGS_1)" in line and "NODELETE" in line for line in read.stdout.splitlines()), library


def test_everything_public_has_a_docstring() -> None:
    for name in vg.__all__:
        thing = getattr(vg, name)
        assert name == "__version__" or (thing.__doc__ or "").strip(), name
        for member in () if not isinstance(thing, type) or not thing.__module__.startswith("vehicle") else vars(thing):
            if not member.startswith("_") and callable(getattr(thing, member)):
                assert (getattr(thing, member).__doc__ or "").strip(), f"{name}.{member}"


def test_types_are_complete_and_true() -> None:
    pytest.importorskip("mypy")
    settings = ["--mypy-config-file", "pyproject.toml", "--allowlist", "tests/stubtest-allowlist.txt"]
    checks = [["mypy"], ["mypy.stubtest", "vehicle_gaussians", *settings]]
    for check in checks:
        ran = subprocess.run(
            [sys.executable, "-m", *check], cwd=BINDINGS, capture_output=True, text=True, timeout=300, check=False
        )
        assert ran.returncode == 0, ran.stdout + ran.stderr
