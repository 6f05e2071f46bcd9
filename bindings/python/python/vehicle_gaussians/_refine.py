"""Optimisation of existing Gaussians against photographs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _native
from ._arguments import listed
from ._documented import documented
from ._progress import Progress
from ._types import Backend

if TYPE_CHECKING:
    from ._native import Gaussians
    from ._scene import Scene


@documented
class Refined(NamedTuple):
    """Result of a refinement."""

    gaussians: Gaussians
    """The best state that was found."""
    report: dict[str, Any]
    """Numbers of steps planned, made and kept, the reason for stopping, and the PSNR before and after."""


def refine(
    gaussians: Gaussians,
    scene: Scene,
    *,
    iterations: int | None = None,
    seconds: float | None = None,
    hold_out: bool = False,
    densify: bool = False,
    backend: Backend = "auto",
    threads: int = 0,
    progress: Progress | None = None,
) -> Refined:
    """Optimises the Gaussians of any model so that their pictures match the photographs of a scene.

    Mirror images are not tied to their originals: all Gaussians move independently. ``reconstruct`` with
    ``refine_iterations`` keeps both sides mirror images.

    gaussians: in the frame of the scene's cameras.
    scene: from ``open_scene``, or ``Scene(images, masks, depths, cameras, names)``.
    iterations, seconds: number of steps, or time in seconds for about as many as fit; 300 steps if neither is given.
    hold_out: hold one of three or more views out, to decide when to stop.
    densify: split, clone and prune Gaussians; without it, their number and order do not change.
    backend: device for rendering and gradients; "auto" is at present the CPU.
    threads: worker threads; 0 means one per core. Equal steps give equal bytes for any number.
    progress: as for ``reconstruct``, with the single stage "refine".

    >>> better = refine(car, scene, iterations=5).gaussians
    """
    refined, report = _native.refine(
        gaussians,
        listed(scene.images, "images", 3),
        listed(scene.masks, "masks", 2),
        listed(scene.cameras, "cameras"),
        listed(scene.depths, "depths", 2),
        listed(scene.names, "names"),
        iterations,
        seconds,
        hold_out,
        densify,
        backend,
        threads,
        progress,
    )
    return Refined(refined, json.loads(report))
