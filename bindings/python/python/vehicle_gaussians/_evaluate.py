"""The errors of a model in all views of a scene, as a table."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy.typing as npt

from ._documented import documented
from ._errors import Status, VgError
from ._measures import ViewErrors
from ._metrics import view_errors
from ._progress import Progress, teller
from ._scene import Scene, open_scene

if TYPE_CHECKING:
    from ._native import Gaussians, Model


@documented
class ViewScore(NamedTuple):
    """A row of the table that ``evaluate`` makes; None where a measure does not exist."""

    name: str
    """The view's name."""
    psnr_db: float
    """Peak signal-to-noise ratio over the full frame, dB; infinite for equal pictures."""
    psnr_box_db: float | None
    """Peak signal-to-noise ratio inside the bounding box of the mask, dB; None where the mask is empty."""
    ssim: float | None
    """Structural similarity over the full frame, at most 1; None for a picture smaller than 11x11."""
    lpips: float | None
    """None without a model that measures it, and for a picture smaller than 64x64."""
    silhouette_iou: float
    """Intersection over union of the mask and the pixels that the model covers by half or more, 0 to 1."""
    depth_mae_m: float | None
    """Mean absolute difference of depth where the view has depth and the model covers the pixel by half or more,
    metres; None where that is nowhere."""
    depth_p90_m: float | None
    """90th percentile of that difference, metres."""


def evaluate(
    gaussians: Gaussians,
    scene: Scene | str | os.PathLike[str],
    views: str | Iterable[str] | None = None,
    vehicle_from_world: npt.ArrayLike | str | os.PathLike[str] | None = None,
    *,
    lpips: Model | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> list[ViewScore]:
    """The errors of a model, drawn on white, in every view of a scene, one row a view.

    scene: of ``open_scene``, or the path that it takes, with ``views`` and ``vehicle_from_world``.
    lpips: the network that measures LPIPS. threads: worker threads; 0 means one per core.
    progress: as for ``reconstruct``, with the one stage "measure".

    ``pandas.DataFrame(rows)`` has the names of the fields as its columns.

    >>> rows = evaluate(car, scene)
    >>> worst = min(rows, key=lambda row: row.psnr_db).name
    """
    if not isinstance(scene, Scene):
        scene = open_scene(scene, views, vehicle_from_world)
    elif views is not None or vehicle_from_world is not None:
        raise VgError(Status.ARGUMENT, "views, vehicle_from_world: given with an open scene; allowed: with a path")
    return rows(scene, lambda *view: view_errors(gaussians, *view, lpips=lpips, threads=threads), progress)


def rows(scene: Any, errors: Callable[..., ViewErrors], progress: Progress | None) -> list[ViewScore]:
    """A row for each view, by the function that measures image, mask, camera and depth."""
    tell = None if progress is None else teller(progress)
    columns = (scene.names, scene.images, scene.masks, scene.cameras, scene.depths)
    table: list[ViewScore] = []
    for name, *view in zip(*columns, strict=True):
        table.append(ViewScore(name, *errors(*view)))
        part = len(table) / len(scene.names)
        if tell is not None and not tell("measure", part, part):
            raise VgError(Status.CANCELLED, "cancelled during measure")
    return table
