"""Docstrings: every public call has an example, which runs; the stub has the docstrings that ``help`` prints.

``VG_BLESS=1 python -m pytest bindings/python/tests/test_docs.py`` copies the docstrings of the extension module, which
come from its Rust sources, into the stub.
"""

from __future__ import annotations

import ast
import doctest
import inspect
import json
import os
import shutil
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, REPOSITORY, SEDAN, Views, looking_at_the_origin
from vehicle_gaussians import capi

STUB = REPOSITORY / "bindings" / "python" / "python" / "vehicle_gaussians" / "_native.pyi"
NATIVE = [name for name in vg.__all__ if getattr(vg, name) is getattr(vg._native, name, None) and name[0] != "_"]
#: Named tuples of results, whose fields have docstrings.
RESULTS = [
    vg.Alignment,
    vg.Gradients,
    vg.PictureErrors,
    vg.Planes,
    vg.Points,
    vg.Refined,
    vg.SurfaceErrors,
    vg.ViewErrors,
    vg.ViewScore,
]


def members(thing: Any) -> Iterator[tuple[str, Any]]:
    """A class's own public methods and properties."""
    for name, member in vars(thing).items() if isinstance(thing, type) else ():
        if not name.startswith("_"):
            yield name, member


def calls() -> Iterator[tuple[str, Any]]:
    """The public calls: functions, classes of the extension module and their methods."""
    for name in vg.__all__:
        thing = getattr(vg, name)
        if inspect.isroutine(thing) or name in NATIVE:
            yield name, thing
            yield from (
                (f"{name}.{member}", getattr(thing, member))
                for member, _ in members(thing)
                if inspect.isroutine(getattr(thing, member))
            )


def test_every_call_has_an_example() -> None:
    without = [name for name, thing in calls() if ">>> " not in (inspect.getdoc(thing) or "")]
    assert not without and len(list(calls())) > 25


def test_the_examples_run(
    ellipsoid: Views, made: vg.Reconstruction, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made.gaussians.save_ply("car.ply")
    shutil.copytree(SEDAN, "my-car")
    scene = json.loads((SEDAN / "transforms.json").read_text())
    scene["frames"] = [frame for frame in scene["frames"] if Path(frame["file_path"]).stem in INPUTS]
    Path("my-car/transforms.json").write_text(json.dumps(scene))
    pose = looking_at_the_origin((5.0, -4.0, 1.0))
    random = np.random.default_rng(1).normal(size=(5, 3))
    names = {
        **{name: getattr(vg, name) for name in vg.__all__},
        "np": np,
        "capi": capi,
        "vehicle_from_camera": pose,
        "other_vehicle_from_camera": np.eye(4),
        "vehicle_from_world": np.diag([2.0, 2.0, 2.0, 1.0]),
        "ego_from_vehicle": pose,
        "ego_from_camera": np.eye(4),
        "frame": scene["frames"][0],
        "centers_in_world": random,
        "centers_in_vehicle": 2 * random,
        "camera": ellipsoid.cameras[0].scaled(200, 150),
        "cameras": ellipsoid.cameras,
        "car": made.gaussians,
        "photograph": np.zeros((150, 200, 3), np.float32),
        "image": np.zeros((150, 200, 3), np.uint8),
        "mask": vg.Renderer(made.gaussians, "cpu").render(ellipsoid.cameras[0].scaled(200, 150)).min(axis=2) < 255,
        "scan": made.gaussians.means,
        "made": made,
        "scene": vg.Scene(
            ellipsoid.images, list(ellipsoid.masks), list(ellipsoid.depths), ellipsoid.cameras, list(INPUTS)
        ),
    }
    modules = [("vehicle_gaussians", vg), ("vehicle_gaussians.capi", capi)]
    documented = [*calls(), *modules, ("VgError", vg.VgError), ("Report", vg.Report)]
    failures: list[str] = []
    ran = 0
    for name, thing in documented:
        test = doctest.DocTestParser().get_doctest(inspect.getdoc(thing) or "", dict(names), name, None, None)
        ran += doctest.DocTestRunner().run(test, out=failures.append).attempted
    assert not failures, "".join(failures)
    assert ran > 40


def test_fields_of_results_are_documented() -> None:
    for result in RESULTS:
        for field in result._fields:
            text = getattr(result, field).__doc__
            assert text and not text.startswith("Alias for"), f"{result.__name__}.{field}"
    assert vg.Alignment.scale.__doc__ == "Metres per unit of the world."


def test_the_stub_has_the_docstrings_of_the_module() -> None:
    written = with_docstrings(STUB.read_text())
    if os.environ.get("VG_BLESS"):
        STUB.write_text(written)
    assert STUB.read_text() == written, "write them with VG_BLESS=1"


def with_docstrings(stub: str) -> str:
    """The stub with the docstrings of public members; of several overloads, the first has it."""
    edits: list[tuple[Any, str]] = []
    for node in ast.parse(stub).body:
        name = getattr(node, "name", "")
        if name not in NATIVE:
            continue
        edits.append((node, inspect.getdoc(getattr(vg, name)) or ""))
        seen = set()
        for member in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(member, ast.FunctionDef) and not member.name.startswith("_") and member.name not in seen:
                seen.add(member.name)
                edits.append((member, inspect.getdoc(getattr(getattr(vg, name), member.name)) or ""))
    lines = stub.split("\n")
    # From the end, so that earlier line numbers stay valid.
    for node, text in sorted(edits, key=lambda edit: -int(edit[0].lineno)):
        first, new = node.body[0], docstring(text, node.col_offset + 4)
        if isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str):
            lines[first.lineno - 1 : first.end_lineno] = new
        elif isinstance(node, ast.ClassDef):
            lines[node.lineno : node.lineno] = new
        else:
            head = lines[first.lineno - 1][: first.col_offset].rstrip()
            lines[first.lineno - 1 : first.end_lineno] = [head, *new]
    return "\n".join(lines)


def docstring(text: str, indent: int) -> list[str]:
    quoted = f'"""{text}"""' if "\n" not in text else f'"""{text}\n"""'
    return textwrap.indent(quoted, " " * indent).split("\n")
