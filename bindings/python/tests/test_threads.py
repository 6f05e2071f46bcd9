"""The GIL, progress, cancelling, Ctrl-C, forks."""

from __future__ import annotations

import multiprocessing
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import vehicle_gaussians as vg
from conftest import SEDAN, Views, same_bytes


class Ticks:
    """Counts how often another thread gets to run Python code."""

    def __enter__(self) -> Ticks:
        self.count = 0
        self.running = True
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        return self

    def run(self) -> None:
        while self.running:
            self.count += 1
            time.sleep(0.001)

    def __exit__(self, *_: Any) -> None:
        self.running = False
        self.thread.join()


def test_other_threads_run_while_the_library_works(sedan: vg.Scene, sedan_made: vg.Reconstruction) -> None:
    # With the GIL held, the other thread would get to run once or twice around each call.
    with Ticks() as ticks:
        before = ticks.count
        vg.reconstruct(sedan.images, sedan.masks, sedan.cameras, threads=1)
        during = ticks.count - before
    assert during > 20
    large = sedan.cameras[0].scaled(4096, 3072)
    with Ticks() as ticks:
        before = ticks.count
        sedan_made.gaussians.render(large, threads=1)
        during = ticks.count - before
    assert during > 20


def test_threads_share_one_model_and_reconstruct_side_by_side(ellipsoid: Views, made: vg.Reconstruction) -> None:
    def job(i: int) -> tuple[bytes, vg.Gaussians]:
        own = vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, ellipsoid.depths)
        return made.gaussians.render(ellipsoid.cameras[i % 4]).tobytes(), own.gaussians

    expected = [made.gaussians.render(camera).tobytes() for camera in ellipsoid.cameras]
    with ThreadPoolExecutor(4) as pool:
        for i, (picture, own) in enumerate(pool.map(job, range(12))):
            assert picture == expected[i % 4]
            assert same_bytes(own, made.gaussians)


def test_progress_is_told_on_the_calling_thread_in_the_order_of_the_stages(ellipsoid: Views) -> None:
    told: list[tuple[str, float, int]] = []

    def progress(stage: str, fraction: float) -> None:
        told.append((stage, fraction, threading.get_ident()))

    vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, progress=progress)
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages == ["plan", "undistort", "calibrate", "prior", "pixels", "head", "symmetry", "check"]
    assert {thread for _, _, thread in told} == {threading.get_ident()}
    assert all(0 <= fraction <= 1 for _, fraction, _ in told)


def test_an_exception_of_the_progress_function_passes_through(ellipsoid: Views) -> None:
    mine = RuntimeError("mine")

    def progress(stage: str, fraction: float) -> None:
        raise mine

    with pytest.raises(RuntimeError) as caught:
        vg.reconstruct(ellipsoid.images, ellipsoid.masks, ellipsoid.cameras, progress=progress)
    assert caught.value is mine


def test_ctrl_c_stops_a_reconstruction() -> None:
    # A shell makes its background jobs ignore Ctrl-C.
    code = f"""
import signal
import vehicle_gaussians as vg
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = vg.open_scene({str(SEDAN)!r}, load_depth=False)
print("ready", flush=True)
while True:
    vg.reconstruct(scene.images, scene.masks, scene.cameras, threads=1)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with child:
        assert child.stdout is not None and child.stdout.readline() == "ready\n"
        time.sleep(0.2)
        child.send_signal(signal.SIGINT)
        try:
            _, errors = child.communicate(timeout=30)
        finally:
            child.kill()
    assert child.returncode == -signal.SIGINT
    assert errors.strip().endswith("KeyboardInterrupt")
    # Inside the call, not after it.
    assert "_native.reconstruct(" in errors


def render_in_child(queue: Any, gaussians: vg.Gaussians, camera: vg.Camera) -> None:
    queue.put(gaussians.render(camera).tobytes())


def test_a_forked_process_draws_too(made: vg.Reconstruction, ellipsoid: Views) -> None:
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    expected = made.gaussians.render(ellipsoid.cameras[0]).tobytes()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=render_in_child, args=(queue, made.gaussians, ellipsoid.cameras[0]))
    child.start()
    assert queue.get(timeout=60) == expected
    child.join(60)
    assert child.exitcode == 0
