"""Gaussians that are there already, fitted to photographs."""

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
    """What a refinement comes back as."""

    gaussians: Gaussians
    """The best that was found."""
    report: dict[str, Any]
    """How many steps were planned, made and kept, why it ended, and the PSNR before and after."""


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
    """Moves the Gaussians of any model until their pictures are the photographs of a scene.

    Nothing is known of which mirrors which: each goes its own way. ``reconstruct`` with ``refine_iterations`` keeps
    both sides mirror images.

    gaussians: in the frame of the scene's cameras.
    scene: of ``open_scene``, or ``Scene(images, masks, depths, cameras, names)``.
    iterations, seconds: so many steps, or as many as fit into about so many seconds; 300 steps if neither is given.
    hold_out: one of three or more views takes no part and tells when to stop.
    densify: Gaussians divide and go on the way; else they keep their number and order.
    backend: who draws and goes back; "auto" is what is known to pay, at present the processor.
    threads: worker threads; 0 means one per core. The same steps give the same bytes with any number.
    progress: as for ``reconstruct``, with the one stage "refine".

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
