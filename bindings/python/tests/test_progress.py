"""Arguments and return values of progress functions; Ctrl-C in long calls."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views, looking_at_the_origin
from vehicle_gaussians import Status, capi

FACES: list[Any] = [vg, capi]

STAGES = ["plan", "undistort", "calibrate", "prior", "pixels", "head", "symmetry", "check"]


@pytest.mark.parametrize("face", FACES)
def test_the_overall_fraction_grows_from_0_to_1_through_all_stages(face: Any, ellipsoid: Views) -> None:
    told: list[tuple[str, float, float]] = []
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    face.reconstruct(*views, refine_iterations=3, progress=lambda *state: told.append(state))
    assert all(len(state) == 2 for state in told)
    told.clear()

    def progress(stage: str, fraction: float, overall: float) -> None:
        told.append((stage, fraction, overall))

    face.reconstruct(*views, refine_iterations=3, progress=progress)
    overall = [state[2] for state in told]
    assert list(dict.fromkeys(state[0] for state in told)) == [*STAGES[:-1], "refine", "check"]
    assert overall == sorted(overall) and overall[0] == 0.0
    assert told[-1] == ("check", 1.0, 1.0)
    # No stage that takes time is nearly nothing or nearly all of the whole.
    assert len({round(part, 2) for part in overall}) > 8


@pytest.mark.filterwarnings("ignore:(bad|doubtful):vehicle_gaussians.VgWarning")
@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("answer", [None, True, 0, 1, "stop", np.False_, np.True_])
def test_only_false_itself_cancels(face: Any, answer: object, ellipsoid: Views) -> None:
    camera = ellipsoid.cameras[0]
    scene = (ellipsoid.images[:1], ellipsoid.masks[:1], [camera])
    made = face.reconstruct(*scene, prior="hull", resolution=0.3, progress=lambda stage, fraction: answer)
    assert len(made.gaussians) > 0


@pytest.mark.parametrize("face", FACES)
def test_false_cancels_where_it_is_returned(face: Any, ellipsoid: Views) -> None:
    told: list[str] = []

    def progress(stage: str, fraction: float) -> bool:
        told.append(stage)
        return stage != "head"

    with pytest.raises(vg.VgError, match="cancelled during head") as caught:
        face.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, progress=progress)
    assert caught.value.code is Status.CANCELLED
    assert told[-1] == "head"


@pytest.mark.filterwarnings("ignore:(bad|doubtful):vehicle_gaussians.VgWarning")
@pytest.mark.parametrize("face", FACES)
def test_a_third_parameter_with_a_default_is_the_callers_own(face: Any, ellipsoid: Views) -> None:
    mine: list[float] = []

    def progress(stage: str, fraction: float, kept: list[float] = mine) -> None:
        kept.append(fraction)

    scene = (ellipsoid.images[:1], ellipsoid.masks[:1], ellipsoid.cameras[:1])
    face.reconstruct(*scene, prior="hull", resolution=0.3, progress=progress)
    assert mine[-1] == 1.0
    with pytest.raises(TypeError, match="progress: int; allowed: a function"):
        face.reconstruct(*scene, progress=7)


class Mine(Exception):
    """An exception of a progress function."""


def fail_at(part: float) -> Callable[[str, float], None]:
    def progress(stage: str, fraction: float) -> None:
        if fraction >= part:
            raise Mine(stage)

    return progress


def drawn(face: Any, gaussians: vg.Gaussians, cameras: list[vg.Camera], progress: Any) -> list[npt.NDArray[np.uint8]]:
    """Interface of vehicle_gaussians.Renderer and of capi.Renderer."""
    if face is vg:
        return vg.Renderer(gaussians, "cpu").render_many(cameras, progress=progress)
    arrays = (getattr(gaussians, name) for name in ("means", "scales", "quats", "opacities", "sh"))
    return list(capi.Renderer(capi.Gaussians.from_arrays(*arrays), "cpu").render(cameras, progress=progress))


@pytest.mark.parametrize("face", FACES)
def test_many_pictures_alignments_and_scenes_tell_their_progress(
    face: Any, ellipsoid: Views, made: vg.Reconstruction
) -> None:
    told: list[tuple[str, float, float]] = []

    def progress(stage: str, fraction: float, overall: float) -> None:
        told.append((stage, fraction, overall))

    calls: list[tuple[str, Callable[[Any], object]]] = [
        ("render", lambda progress: drawn(face, made.gaussians, ellipsoid.cameras, progress)),
        ("read", lambda progress: face.open_scene(SEDAN, INPUTS, progress=progress)),
        ("align", lambda progress: aligned(face, ellipsoid, made, 1, progress)),
    ]
    for stage, call in calls:
        told.clear()
        call(progress)
        assert told[0] == (stage, 0.0, 0.0) and told[-1] == (stage, 1.0, 1.0)
        assert told == sorted(told) and all(fraction == overall for _, fraction, overall in told)
        with pytest.raises(Mine):
            call(fail_at(1.0))
        with pytest.raises(vg.VgError, match=f"cancelled during {stage}"):
            call(lambda stage, fraction: False)


def aligned(face: Any, ellipsoid: Views, made: vg.Reconstruction, times: int, progress: Any) -> vg.Alignment:
    """The ellipsoid's own frame, by its surface; ``times`` as many views."""
    masks, cameras = times * ellipsoid.masks, times * ellipsoid.cameras
    alignment: vg.Alignment = face.align_scan(
        masks, cameras, made.gaussians.means, heading="forward", progress=progress
    )
    return alignment


def haze(count: int) -> vg.Gaussians:
    """Gaussians that cover the whole picture without saturating a pixel: all are blended into every pixel."""
    depth = np.linspace(0.0, 1.0, count, dtype=np.float32)
    means = np.stack([depth, 0 * depth, 0 * depth], axis=1)
    quats = np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    return vg.Gaussians.from_arrays(
        means,
        np.full_like(means, 100.0),
        quats,
        np.full(count, 0.0045, np.float32),
        np.zeros((count, 1, 3), np.float32),
    )


@contextmanager
def ctrl_c_after(seconds: float) -> Iterator[list[float]]:
    """Interrupts this process and records the time."""
    pressed: list[float] = []

    def press() -> None:
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(seconds, press)
    timer.start()
    try:
        yield pressed
    finally:
        timer.join()
        signal.signal(signal.SIGINT, usual)


#: Calls that would each take minutes.
LONG_CALLS = [
    "render",
    "render_planes",
    "render_backward",
    "render_many",
    "surface_errors",
    "view_errors",
    "align_scan",
]


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("name", LONG_CALLS)
def test_ctrl_c_ends_every_long_call(face: Any, name: str, ellipsoid: Views, made: vg.Reconstruction) -> None:
    model = haze(20_000)
    camera = vg.Camera.from_matrix(
        np.array([[1000.0, 0, 1000], [0, 1000, 750], [0, 0, 1]]), looking_at_the_origin((6.0, -4.0, 0.8)), 2000, 1500
    )
    if face is capi:
        arrays = (getattr(model, field) for field in ("means", "scales", "quats", "opacities", "sh"))
        model = capi.Gaussians.from_arrays(*arrays)
    ones = np.ones((1500, 2000), np.float32)
    photograph = np.full((1500, 2000, 3), 255, np.uint8)
    calls: dict[str, Callable[[], object]] = {
        "render": lambda: model.render(camera),
        "render_planes": lambda: model.render_planes(camera),
        "render_backward": lambda: model.render_backward(camera, alpha=ones),
        "render_many": lambda: (
            drawn(vg, haze(20_000), 50 * [camera], None)
            if face is vg
            else capi.Renderer(model, "cpu").render(20 * [camera])
        ),
        "surface_errors": lambda: face.surface_errors(model, made.gaussians.means),
        "view_errors": lambda: face.view_errors(model, photograph, None, camera),
        "align_scan": lambda: aligned(face, ellipsoid, made, 500, None),
    }
    with ctrl_c_after(0.3) as pressed:
        with pytest.raises(KeyboardInterrupt):
            calls[name]()
        let_go = time.monotonic() - pressed[0]
    assert let_go < 5.0


def test_ctrl_c_is_the_callers_where_its_handler_does_not_raise(ellipsoid: Views, made: vg.Reconstruction) -> None:
    heard: list[int] = []
    usual = signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        os.kill(os.getpid(), signal.SIGINT)
        for face in FACES:
            assert len(face.open_scene(SEDAN, INPUTS[:1]).images) == 1
    finally:
        signal.signal(signal.SIGINT, usual)
    assert heard == [signal.SIGINT]


def test_views_that_are_left_are_not_read_after_a_failure(tmp_path: Path) -> None:
    told: list[float] = []

    def progress(stage: str, fraction: float) -> None:
        told.append(fraction)
        raise Mine

    for face in FACES:
        told.clear()
        with pytest.raises(Mine):
            face.open_scene(SEDAN, progress=progress)
        assert told == [0.0]
