"""Networks: errors of a package without ONNX Runtime, and errors that are the same in every build."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import vehicle_gaussians as vg
from conftest import REPOSITORY, Views
from vehicle_gaussians import Status, capi

BINDINGS = REPOSITORY / "bindings" / "python"
FACES = [vg, capi]


def refusal(face: Any, *arguments: Any, **named: Any) -> vg.VgError:
    with pytest.raises(vg.VgError) as caught:
        face.Model(*arguments, **named)
    return caught.value


def is_built(face: Any) -> bool:
    """Whether this package was built with networks; the error is then about the missing file."""
    return refusal(face, "/nowhere/at/all.onnx").code is Status.IO


@pytest.mark.parametrize("face", FACES)
def test_a_model_that_cannot_be_opened_says_why(face: Any, tmp_path: Path) -> None:
    error = refusal(face, tmp_path / "no.onnx", threads=2, prepack=True, arena=True, fall_back=True, provider="cuda")
    if is_built(face):
        assert error.code is Status.IO and str(tmp_path / "no.onnx") in str(error)
    else:
        assert error.code is Status.NOT_BUILT and "build with the feature onnx" in str(error)


@pytest.mark.parametrize("face", FACES)
def test_arguments_of_a_model_are_checked_first(face: Any) -> None:
    for named, words in [
        ({"provider": "tpu"}, r"^provider: .tpu.; allowed: cpu, cuda"),
        ({"threads": 1025}, r"^(options\.)?threads: 1025; allowed: 0 to 1024"),
    ]:
        error = refusal(face, "/nowhere/at/all.onnx", **named)
        assert error.code is Status.ARGUMENT and re.search(words, str(error)), str(error)
    with pytest.raises(TypeError):
        face.Model()


@pytest.mark.parametrize("face", FACES)
def test_the_prior_onnx_needs_a_model(face: Any, ellipsoid: Views) -> None:
    with pytest.raises(vg.VgError, match=r"^(options\.)?prior") as caught:
        face.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, prior="onnx")
    assert caught.value.code is (Status.ARGUMENT if is_built(face) else Status.NOT_BUILT)


def test_a_path_is_no_model(ellipsoid: Views) -> None:
    views: list[Any] = [ellipsoid.images, ellipsoid.masks, ellipsoid.cameras]
    path: Any = "m.onnx"
    with pytest.raises(TypeError, match="prior_model"):
        vg.reconstruct(*views, prior="onnx", prior_model=path)
    with pytest.raises(TypeError, match="head_model"):
        vg.reconstruct(*views, head_model=path)
    with pytest.raises(TypeError, match="^prior_model: str; allowed: a Model"):
        capi.reconstruct(*views, prior="onnx", prior_model=path)
    with pytest.raises(TypeError, match="^head_model: str; allowed: a Model"):
        capi.reconstruct(*views, head_model=path)
    with pytest.raises(TypeError, match="model"):
        vg.segment(path, ellipsoid.images[0], ellipsoid.cameras[0])
    with pytest.raises(TypeError, match="^model: str; allowed: a Model"):
        capi.segment(path, ellipsoid.images[0], ellipsoid.cameras[0])


def test_features_are_passed_on_by_the_build_backend() -> None:
    code = (
        "import build_backend as b\n"
        "assert b.for_maturin(None) is None and b.features_of({'build-args': '-v'}) == []\n"
        "assert b.for_maturin({'features': 'onnx'}) == {'build-args': '--features onnx'}\n"
        "b.features_of({'features': 'cuda'})\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=BINDINGS, capture_output=True, text=True, check=False)
    assert ran.returncode == 1 and "features: 'cuda'; allowed: gpu, onnx" in ran.stderr, ran.stderr
