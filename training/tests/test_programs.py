"""The programs with something missing: one line with the cause and the remedy, exit code 2, no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest

from conftest import PACKAGE, Program

PROGRAMS = ["tiny", "mapanything", "depth_anything_3", "lpips", "segmentation"]
HEAVY = ("torch", "onnx", "onnxruntime", "onnxscript", "numpy", "torchvision", "mapanything", "lpips")


@pytest.mark.parametrize("name", [*PROGRAMS, "contract"])
def test_help_needs_no_package(program: Program, name: str) -> None:
    done = program(name, "--help", without=HEAVY)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"usage: python -m vehicle_gaussians.export.{name}" in done.stdout


@pytest.mark.parametrize(
    ("name", "without", "words"),
    [
        ("tiny", "torch", "torch is not installed: pip install torch onnx onnxscript onnxruntime"),
        ("tiny", "onnxruntime", "onnxruntime is not installed: pip install torch onnx onnxscript onnxruntime"),
        ("mapanything", "torch", "torch is not installed: pip install torch onnx onnxscript onnxruntime"),
        (
            "mapanything",
            "mapanything",
            'mapanything is not installed: pip install "mapanything @ '
            'git+https://github.com/facebookresearch/map-anything"',
        ),
        (
            "depth_anything_3",
            "depth_anything_3",
            "depth_anything_3 is not installed: pip install --no-deps depth-anything-3 && "
            "pip install omegaconf addict einops e3nn",
        ),
        ("lpips", "torchvision", "torchvision is not installed: pip install torchvision"),
        ("segmentation", "torchvision", "torchvision is not installed: pip install torchvision"),
        ("contract", "onnx", "onnx is not installed: pip install onnx"),
    ],
)
def test_a_missing_package_is_named_with_its_command(program: Program, name: str, without: str, words: str) -> None:
    arguments = ["missing.onnx"] if name == "contract" else []
    done = program(name, *arguments, without=(without,))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"vehicle_gaussians.export.{name}: error: {words}\n"


def test_a_package_that_lacks_another_names_both(program: Program) -> None:
    pytest.importorskip("lpips")
    done = program("lpips", without=("lpips.lpips",))
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "lpips is not installed completely (" in done.stderr and done.stderr.endswith(": pip install lpips\n")


@pytest.mark.parametrize("name", ["tiny", "mapanything", "depth_anything_3"])
def test_a_size_that_is_not_a_multiple_of_a_patch_is_refused(program: Program, name: str) -> None:
    done = program(name, "--size", "512x384", without=HEAVY)
    assert done.returncode == 2
    assert done.stderr == f"vehicle_gaussians.export.{name}: error: --size: 512x384; allowed: multiples of 14\n"


def test_unavailable_weights_are_named_with_the_command_to_get_them(program: Program) -> None:
    pytest.importorskip("depth_anything_3.model.da3")
    done = program("depth_anything_3")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith(
        "vehicle_gaussians.export.depth_anything_3: error: weights depth-anything/DA3-BASE cannot be"
    )
    assert last.endswith("`hf download depth-anything/DA3-BASE --local-dir DIR`, then --weights DIR")


def test_weights_in_a_folder_without_them_are_refused(program: Program, tmp_path: Path) -> None:
    pytest.importorskip("depth_anything_3.model.da3")
    done = program("depth_anything_3", "--weights", str(tmp_path), "--license", "MIT")
    assert done.returncode == 2
    assert f"weights {tmp_path}: no config.json; `hf download REPOSITORY --local-dir DIR`" in done.stderr


def test_weights_of_unknown_licence_need_one(program: Program, tmp_path: Path) -> None:
    pytest.importorskip("depth_anything_3.model.da3")
    done = program("depth_anything_3", "--weights", str(tmp_path))
    assert done.returncode == 2
    assert f"error: --license: missing; the licence of {tmp_path} is not known here, known are: depth-" in done.stderr


def test_an_unavailable_backbone_is_named_with_its_address(program: Program) -> None:
    pytest.importorskip("lpips")
    done = program("lpips", "--net", "squeeze")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert (
        "where the network is, `curl -O https://download.pytorch.org/models/squeezenet1_1-b8a52dc0.pth`, "
        "then --backbone squeezenet1_1-b8a52dc0.pth\n"
    ) in done.stderr


def test_a_missing_backbone_file_is_refused_first(program: Program) -> None:
    done = program("lpips", "--backbone", "missing.pth", without=HEAVY)
    assert done.returncode == 2
    assert done.stderr == "vehicle_gaussians.export.lpips: error: --backbone: missing.pth: no such file\n"


def test_the_library_does_not_import_the_programs() -> None:
    for source in PACKAGE.glob("*.py"):
        imports = [line for line in source.read_text().splitlines() if "import" in line.split()]
        assert not [line for line in imports if "export" in line], source.name
