"""Scenes on disk."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _native
from ._arguments import listed
from ._equal import equal_by_value
from ._native import Camera
from ._progress import Progress


@equal_by_value
@dataclass(frozen=True, eq=False)
class Scene:
    """Views of one vehicle, one list entry each, as the arguments of ``reconstruct``."""

    images: list[npt.NDArray[np.uint8]]
    """RGB, uint8 (height, width, 3)."""
    masks: list[npt.NDArray[np.bool_] | None]
    """True is vehicle, (height, width); None where there is no mask."""
    depths: list[npt.NDArray[np.float32] | None]
    """Metres along the optical axis, 0 for no measurement, float32 (height, width); None for no depth map."""
    cameras: list[Camera]
    """Cameras, posed in the vehicle's frame."""
    names: list[str]
    """Paths of the pictures below their images folder."""


def open_scene(
    path: str | os.PathLike[str],
    views: str | Iterable[str] | None = None,
    vehicle_from_world: npt.ArrayLike | str | os.PathLike[str] | None = None,
    *,
    depth_scale: float | None = None,
    load_depth: bool = True,
    progress: Progress | None = None,
) -> Scene:
    """Opens a scene: a ``transforms.json`` in nerfstudio's format, a folder that holds one, or a COLMAP folder.

    views: views to read, in this order, by path, file name, or file name without extension; all if not given.
    vehicle_from_world: the similarity from the scene's world to the vehicle's frame, as a 4x4 matrix or the JSON file
    that holds one. A COLMAP model needs it; without it, a transforms.json is taken to be in the vehicle's frame.
    depth_scale: metres per unit of the depth files; overrides the scene's value.
    progress: as for ``reconstruct``, with the single stage "read".

    Legal input that looks like a mistake is reported as a warning.

    >>> scene = open_scene("my-car", ["000", "002"])
    >>> scene.names
    ['000.png', '002.png']
    """
    if views is not None:
        views = [views] if isinstance(views, str) else listed(views, "views")
    return Scene(*_native.open_scene(path, views, vehicle_from_world, depth_scale, load_depth, progress))
