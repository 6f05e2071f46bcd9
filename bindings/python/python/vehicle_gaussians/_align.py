"""From the world of a structure-from-motion model to the vehicle's frame."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy.typing as npt

from . import _native
from ._alignment import Alignment
from ._arguments import listed
from ._progress import Progress
from ._types import Floats, Heading

if TYPE_CHECKING:
    from ._native import Camera


def align_scan(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    scan: Floats,
    sparse: npt.ArrayLike | None = None,
    *,
    heading: Heading = "auto",
    names: Sequence[str] | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> Alignment:
    """Finds the vehicle's frame from points scanned on the vehicle, whose outline must match the edges of all masks.

    masks: one for each camera, of which at least 3 are not None. cameras: with poses in the world, whose origin,
    orientation and unit are arbitrary. scan: floats (n, 3), metres, vehicle frame. sparse: (n, 3), points of the world,
    of any objects. heading: "auto", an error if front and back fit equally well; "forward": the first view by name that
    is not seen square from the side was taken from ahead of the vehicle's centre; "backward": from behind it.
    names: names of the views for messages; "000", "001", ... if not given. threads: worker threads; 0 means one per
    core. progress: as for ``reconstruct``, with the single stage "align".

    >>> alignment = align_scan(masks, cameras_in_world, scan)  # doctest: +SKIP
    >>> scene = open_scene("my-car", vehicle_from_world=alignment.vehicle_from_world)  # doctest: +SKIP
    """
    views = listed(masks, "masks", 2), listed(cameras, "cameras")
    names = None if names is None else listed(names, "names")
    return Alignment(*_native.align_scan(*views, scan, sparse, heading, names, threads, progress))


def align_box(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    sparse: npt.ArrayLike,
    size: npt.ArrayLike,
    *,
    heading: Literal["forward", "backward"],
    names: Sequence[str] | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> Alignment:
    """Finds the vehicle's frame from its size and the ground; the origin is the box's centre.

    size: length, width and height, metres. sparse: points of the world, some of them on level ground around the
    vehicle. heading: "forward" or "backward", which a box does not determine. The other arguments are as for
    ``align_scan``, with masks from all around.

    >>> alignment = align_box(masks, cameras_in_world, sparse, (4.6, 1.9, 1.5), heading="forward")  # doctest: +SKIP
    """
    views = listed(masks, "masks", 2), listed(cameras, "cameras")
    names = None if names is None else listed(names, "names")
    return Alignment(*_native.align_box(*views, sparse, size, heading, names, threads, progress))


def align_points(world: npt.ArrayLike, vehicle: npt.ArrayLike) -> Alignment:
    """Finds the similarity that maps points of the world, for example camera centres, to their measured positions.

    world, vehicle: (n, 3), the same points in both frames, the second in metres; at least 3, not on one line. With 6 or
    more points, outliers are left out.

    >>> alignment = align_points(world=np.eye(3), vehicle=2 * np.eye(3))
    >>> round(alignment.scale, 6)
    2.0
    """
    return Alignment(*_native.align_points(world, vehicle))


def align_folder(
    path: str | os.PathLike[str],
    scan: str | os.PathLike[str] | None = None,
    *,
    heading: Heading = "auto",
    threads: int = 0,
    progress: Progress | None = None,
) -> Alignment:
    """Runs ``align_scan`` on the files of a scene: a COLMAP folder, one of 3DRealCar, or a ``transforms.json``.

    scan: a PLY file of points, metres, vehicle frame; if not given, the scan in a folder of 3DRealCar.

    >>> alignment = align_folder("3drealcar/2024_06_04_13_44_39")  # doctest: +SKIP
    """
    return Alignment(*_native.align_folder(path, scan, heading, threads, progress))
