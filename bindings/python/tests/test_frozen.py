"""Arrays of Gaussians cannot be written through any protocol."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN
from vehicle_gaussians import capi

FACES = [vg, capi]
ARRAYS = ("means", "scales", "quats", "opacities", "sh")


@pytest.fixture(params=FACES, ids=["native", "ctypes"])
def gaussians(request: pytest.FixtureRequest) -> Any:
    n = 6
    ones = np.ones((n, 4))
    return request.param.Gaussians.from_arrays(ones[:, :3], ones[:, :3], ones, ones[:, 0], np.zeros((n, 4, 3)))


class OldReader:
    """Requests the array without a version, as consumers of DLPack before 1.0 do."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __dlpack__(self, **how: Any) -> Any:
        return self.array.__dlpack__()

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_written_through_dlpack_stays_out_of_the_gaussians(gaussians: Any, name: str) -> None:
    array = getattr(gaussians, name)
    before = array.tobytes()
    for view in (array, array[1:3], array.T, array.reshape(-1), array.view()):
        for reader in (view, OldReader(view)):
            taken = np.from_dlpack(reader)
            assert not np.shares_memory(taken, array) and np.array_equal(taken, view)
            if taken.flags.writeable:
                taken[...] = np.nan
    assert getattr(gaussians, name).tobytes() == before


def test_dlpack_without_a_copy_is_refused(gaussians: Any) -> None:
    with pytest.raises(BufferError, match="read-only memory of vehicle_gaussians"):
        gaussians.means.__dlpack__(copy=False)
    if int(np.__version__.split(".")[0]) >= 2:
        with pytest.raises(BufferError, match="read-only memory of vehicle_gaussians"):
            np.from_dlpack(gaussians.means, copy=False)
        assert np.from_dlpack(gaussians.means, copy=True).flags.writeable


@pytest.mark.parametrize("name", ARRAYS)
def test_no_flag_and_no_buffer_makes_them_writable(gaussians: Any, name: str) -> None:
    array = getattr(gaussians, name)
    for view in (array, array[1:], np.asarray(array), array.view(np.ndarray), array.base):
        if isinstance(view, np.ndarray):
            with pytest.raises(ValueError, match="cannot set WRITEABLE"):
                view.setflags(write=True)
            with pytest.raises(ValueError, match="read-only"):
                view[...] = 0
        assert memoryview(array).readonly
    with pytest.raises(ValueError, match="read-only"):
        np.add(array, 1, out=array)


def test_what_is_made_of_them_is_an_ordinary_array(gaussians: Any) -> None:
    means = gaussians.means
    made = (
        means * 2,
        means.copy(),
        copy.copy(means),
        copy.deepcopy(means),
        means.min(0),
        np.concatenate([means, means]),
    )
    for array in made:
        assert type(array) is np.ndarray and array.flags.writeable
    assert type(pickle.loads(pickle.dumps(means))) is np.ndarray
    assert isinstance(means.max(), np.float32) and isinstance(means[0, 0], np.float32)
    # Arrays that no longer point to the library's memory are not copied.
    changed = means.copy()
    assert np.shares_memory(np.from_dlpack(changed), changed)


def test_views_of_scenes_are_frozen_too() -> None:
    scene = capi.open_scene(SEDAN, INPUTS[:1])
    before = scene.images[0].tobytes()
    assert not np.shares_memory(np.from_dlpack(scene.images[0]), scene.images[0])
    assert scene.images[0].tobytes() == before
