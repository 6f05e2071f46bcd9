"""Pickle and copy: values are restored bit for bit, objects that belong to a process raise an error; equality."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN, Views, same_bytes
from vehicle_gaussians import capi

FACES = [vg, capi]


def pickled(protocol: int) -> Callable[[Any], Any]:
    return lambda thing: pickle.loads(pickle.dumps(thing, protocol))


WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{f"pickle {protocol}": pickled(protocol) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)},
}


def some_gaussians(face: Any, seed: int = 1, n: int = 500) -> Any:
    random = np.random.default_rng(seed)
    scales, opacities = random.uniform(0.01, 0.1, (n, 3)), random.uniform(size=n)
    return face.Gaussians.from_arrays(
        random.normal(size=(n, 3)), scales, random.normal(size=(n, 4)), opacities, random.normal(size=(n, 9, 3))
    )


def bent_cameras() -> list[vg.Camera]:
    """Every kind of lens, at poses whose last bits would change if they were orthonormalised again."""
    random = np.random.default_rng(7)
    K = [[600, 0, 320.1], [0, 610, 1 / 3], [0, 0, 1]]
    lenses: list[Any] = [None, [0, 0, 0, 0], [0.1, -0.2, 1e-3, 2e-3], [0.1, -0.2, 1e-3, 2e-3, 0.3]]
    poses = [vg.pose_from_colmap(random.normal(size=4), random.normal(size=3)) for _ in range(20)]
    bent = [vg.Camera.from_opencv(K, pose, 640, 480, lens) for pose in poses for lens in lenses]
    return [*bent, vg.Camera.from_opencv(K, poses[0], 640, 480, [0.1, 0.2, 0.3, 0.4], fisheye=True)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("face", FACES)
def test_gaussians_come_back_to_the_last_bit_and_live_on(face: Any, way: str) -> None:
    original = some_gaussians(face)
    expected = some_gaussians(face)
    again = WAYS[way](original)
    del original
    gc.collect()
    # The memory of a handle that was freed by mistake would be reused here.
    junk = [some_gaussians(face, seed) for seed in range(4)]
    assert type(again) is face.Gaussians and same_bytes(again, expected) and len(junk) == 4
    assert again.mirrored() == expected.mirrored()


@pytest.mark.parametrize("way", WAYS)
def test_cameras_come_back_equal(way: str) -> None:
    for camera in bent_cameras():
        again = WAYS[way](camera)
        assert again == camera and hash(again) == hash(camera)
    structure = capi.camera_from_colmap("PINHOLE", 64, 48, [50, 50, 32, 24], np.eye(4))
    again = WAYS[way](structure)
    assert again == structure and again is not structure
    again.params[0] = 60
    assert again != structure and structure.params[0] == 50


def things(face: Any, ellipsoid: Views) -> dict[str, Any]:
    """Objects of users that are not handles."""
    views = (ellipsoid.images, ellipsoid.masks, ellipsoid.cameras)
    made = face.reconstruct(*views, ellipsoid.depths, points=True)
    world = np.random.default_rng(2).normal(size=(8, 3))
    camera = ellipsoid.cameras[0]
    return {
        "scene": face.open_scene(SEDAN, INPUTS[:2]),
        "reconstruction": made,
        "alignment": face.align_points(world, 2 * world),
        "picture errors": face.picture_errors(ellipsoid.images[0], ellipsoid.images[1]),
        "view errors": face.view_errors(made.gaussians, ellipsoid.images[0], ellipsoid.masks[0], camera),
        "surface errors": face.surface_errors(made.gaussians, made.points.positions),
        "planes": made.gaussians.render_planes(camera),
        "gradients": made.gaussians.render_backward(camera, alpha=np.ones((72, 96))),
    }


@pytest.mark.parametrize("face", FACES)
def test_scenes_results_and_measures_come_back_equal_here_and_from_a_spawned_process(
    face: Any, ellipsoid: Views
) -> None:
    held = things(face, ellipsoid)
    for name, thing in held.items():
        for way, carry in WAYS.items():
            again = carry(thing)
            assert type(again) is type(thing) and again == thing and not again != thing, f"{name}: {way}"
    values = [*held.values(), ellipsoid.cameras[0], held["reconstruction"].gaussians]
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        for value, returned in zip(values, pool.map(copy.copy, values), strict=True):
            assert type(returned) is type(value) and returned == value


@pytest.mark.parametrize("face", FACES)
def test_what_belongs_to_its_process_is_refused_with_the_way_out(face: Any) -> None:
    refused = [(face.Renderer(some_gaussians(face), "cpu"), r"Renderer\(gaussians, backend\)")]
    if face is capi:
        # No file is needed: the refusal does not read the model.
        refused += [(capi.Context(1), r"Context\(threads\)"), (capi.Model.__new__(capi.Model), r"Model\(path\)")]
    for thing, way_out in refused:
        for way in WAYS.values():
            with pytest.raises(TypeError, match=rf"^{type(thing).__name__}: cannot be pickled or copied.*{way_out}$"):
                way(thing)
        with pytest.raises(TypeError, match="cannot be pickled or copied"):
            pickle.dumps({"held": [thing]})
    # A package without networks cannot open a model to test this with.
    assert "__reduce__" in vars(vg.Model) and "__reduce__" in vars(vg.Renderer)


@pytest.mark.parametrize("face", FACES)
def test_equal_is_what_holds_the_same_values(face: Any, ellipsoid: Views) -> None:
    one, same, other = some_gaussians(face), some_gaussians(face), some_gaussians(face, seed=2)
    assert one == same and hash(one) == hash(same) and len({one, same, other}) == 2
    assert one != other and one != 3 and one != one.mirrored() and not one == other
    planes = one.render_planes(ellipsoid.cameras[0])
    assert planes == same.render_planes(ellipsoid.cameras[0]) != other.render_planes(ellipsoid.cameras[0])
    assert planes != planes._replace(depth=planes.depth + 1) and planes == tuple(planes) and planes != 3
    assert planes != planes._replace(depth=planes.depth.astype(np.float64))
    scene, again = face.open_scene(SEDAN, INPUTS[:1]), face.open_scene(SEDAN, INPUTS[:1])
    assert scene == again and scene != face.open_scene(SEDAN, INPUTS[1:2])
