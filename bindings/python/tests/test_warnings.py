"""Warnings, and lines for the logger, equal in both interfaces."""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings
from typing import Any

import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views
from vehicle_gaussians import capi

FACES: list[Any] = [vg, capi]


@pytest.mark.parametrize("face", FACES)
def test_depth_that_one_view_lacks_bends_the_shape_and_warns_of_the_callers_line(
    face: Any, ellipsoid: Views, caplog: pytest.LogCaptureFixture
) -> None:
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    some = [*ellipsoid.depths[:3], None]
    with pytest.warns(vg.VgWarning, match="^depth: 1 of 4 views have none: .* measured points") as caught:
        made = face.reconstruct(*views, some, check=False)
    assert [warning.filename for warning in caught] == [__file__]
    assert "depth: 1 of 4 views have none" in caplog.text
    assert made.report["prior"] == "shape" and made.report["cloud"]["used"] > 1000
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        without = face.reconstruct(*views, [None] * 4, check=False)
        asked = face.reconstruct(*views, some, prior="shape", check=False)
    assert without.report["cloud"] is None
    # An explicit prior "shape" ignores the depth.
    assert asked.gaussians.means.tobytes() == without.gaussians.means.tobytes()
    # The view without depth gains from the depth of the others.
    last = (ellipsoid.images[3], ellipsoid.masks[3], ellipsoid.cameras[3], ellipsoid.depths[3])
    errors = [face.view_errors(model.gaussians, *last).depth_mae_m for model in (made, without)]
    assert errors[0] < 0.7 * errors[1], errors


@pytest.mark.filterwarnings("ignore:(bad|doubtful):vehicle_gaussians.VgWarning")
@pytest.mark.parametrize("face", FACES)
def test_a_budget_that_was_not_kept_warns(face: Any, ellipsoid: Views) -> None:
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    with pytest.warns(
        vg.VgWarning, match=r"^budget: 0\.0001 s was not kept: the call took \d+\.\d\d s, though all"
    ) as caught:
        made = face.reconstruct(*views, budget=1e-4)
    # A model of one coarse view also has a poor verdict, which is a further warning.
    assert {warning.filename for warning in caught} == {__file__}
    told = [str(warning.message) for warning in caught]
    assert [text for text in told if not text.startswith(("bad: ", "doubtful: "))] == made.report["warnings"]


@pytest.mark.parametrize("face", FACES)
def test_the_logger_is_told_what_was_done(face: Any, ellipsoid: Views, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "vehicle_gaussians")
    made = face.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, prior="hull", resolution=0.5)
    lines = [(record.name, record.levelno, record.getMessage()) for record in caplog.records]
    assert {name for name, _, _ in lines} == {"vehicle_gaussians"}
    by_level = {level: [text for _, found, text in lines if found == level] for level in (logging.DEBUG, logging.INFO)}
    assert len(by_level[logging.DEBUG]) == len(made.report["stages"])
    assert by_level[logging.INFO][-1].startswith(f"{len(made.gaussians)} Gaussians from depth prior hull in ")
    assert any("left out" in text and "averaged into fewer" in text for text in by_level[logging.INFO])


def test_without_a_handler_a_warning_is_printed_once() -> None:
    code = f"""
import vehicle_gaussians as vg
scene = vg.open_scene({str(SEDAN)!r}, {list(INPUTS[:1])!r})
vg.reconstruct(scene.images, scene.masks, scene.cameras, prior="hull", resolution=0.2, budget=1e-4)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.count("budget: ") == 1 and "VgWarning" in done.stderr
