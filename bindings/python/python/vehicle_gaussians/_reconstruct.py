"""Reconstruction from photographs in memory."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native
from ._arguments import listed
from ._documented import documented
from ._equal import equal_by_value
from ._native import Camera, Gaussians, Model
from ._progress import Progress
from ._types import Backend, Calibrate, Floats, Keep, Mask, Placed, Prior, Relight, Size, Symmetry
from ._warn import reconstructed


@equal_by_value
@documented
class Points(NamedTuple):
    """The metric coloured point cloud: a point for every vehicle pixel with depth."""

    positions: npt.NDArray[np.float32]
    """Metres, vehicle frame; float32 (n, 3)."""
    colors: npt.NDArray[np.uint8]
    """sRGB; uint8 (n, 3)."""


@equal_by_value
@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A finished reconstruction."""

    gaussians: Gaussians
    """The model of the vehicle."""
    report: dict[str, Any]
    """The report: what was done, how long it took, what was left out and why."""
    points: Points | None
    """The point cloud, if requested."""


def reconstruct(
    images: Iterable[npt.NDArray[np.uint8]],
    masks: Iterable[Mask | None] | None,
    cameras: Iterable[Camera],
    depths: Iterable[Floats | None] | None = None,
    *,
    prior: Prior = "auto",
    prior_model: Model | None = None,
    head_model: Model | None = None,
    calibrate: Calibrate = "auto",
    symmetry: Symmetry = "auto",
    relight: Relight = "auto",
    photo: bool = True,
    cloud: Floats | None = None,
    vehicle_size: Size | None = None,
    vehicle_place: Placed | None = None,
    sh_degree: int = 2,
    keep: Keep | Iterable[Keep] = (),
    check: bool = True,
    points: bool = False,
    budget: float | None = None,
    resolution: float = 1.0,
    max_views: int | None = None,
    max_gaussians: int | None = 12_000_000,
    refine_iterations: int | None = None,
    refine_seconds: float | None = None,
    refine_hold_out: bool = False,
    refine_backend: Backend = "auto",
    threads: int = 0,
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstructs the vehicle in the photographs.

    images: RGB, uint8 (height, width, 3); the alpha of a fourth channel is the mask where none is given.
    masks: (height, width), bool or uint8 where 128 and above is vehicle, or 1 of 0 and 1; None for no mask.
    cameras: one per image, posed in the vehicle's frame (x forward, y left, z up, metres; y = 0 is the plane of
    symmetry).
    depths: floats (height, width), metres along the optical axis, 0 for no measurement.
    prior: depth source: the scene's own depth ("given"); the visual hull ("hull"); the hull corrected by a shape model
    of vehicles ("shape"); the network of prior_model ("onnx"); or ("auto") the scene's own depth if every used view has
    it, else the shape, fitted to the depth of the views that have it, with a warning.
    prior_model, head_model: networks that estimate depth, and that make Gaussians from pixels.
    calibrate: correct the plane of symmetry and the cameras where the silhouettes contradict them ("auto"), or use them
    as given ("off").
    symmetry: mirror the unobserved parts ("auto"), all of the denser side ("always"), nothing ("never"), or the
    photographs instead of the model ("flip").
    relight: relight mirror images for their own side, as far as the observed light allows ("auto"), or leave their
    colours as observed ("never").
    photo: correct the shape prior's surface by photo-consistency.
    cloud: points measured on the vehicle, floats (n, 3), metres, vehicle frame, all finite; it may contain outliers.
    Priors "shape" and "hull" fit their surface to them.
    vehicle_size: length, width, height in metres, if known to a few centimetres; the silhouettes determine the pose of
    a box of this size, and no part of the vehicle is placed outside it.
    vehicle_place: x, y, z of that box's centre, metres, and its rotation about z, radians, in the frame of the cameras,
    if known to a few decimetres. Its middle plane, not y = 0, is then the plane of symmetry; the result stays in the
    frame of the cameras.
    sh_degree: highest degree of the spherical harmonics that hold the colour; 0 to 3.
    keep: omissions that the plan must not make: "duplicate-views", "overlap", "silhouette-edge", "floaters",
    "sh-bands", or "all".
    check: draw the model into its input views and report the error there.
    points: return the metric coloured point cloud as well.
    budget: time limit of the reconstruction in seconds; steps that do not fit are left out. None: as long as it takes.
    resolution: resample the views first to this fraction of their width and height; a budget may choose less; above 0,
    at most 1.
    max_views: use at most this many views, chosen to spread best around the vehicle; a budget may choose fewer. None:
    all.
    max_gaussians: largest number of Gaussians, estimated from the masks; where they would give more, the views are
    resampled to fewer pixels, and the report says so. None: any number.
    refine_iterations, refine_seconds: optimise the model against the photographs for a number of steps, or for about a
    number of seconds, in addition to a budget; the report holds the number of steps.
    refine_hold_out: hold one of three or more views out of the optimisation, to decide when to stop.
    refine_backend: device for rendering and gradients in the optimisation; "auto" is at present the CPU.
    threads: worker threads; 0 means one per core. The result is the same for any number.
    names: names of the views for messages and the report.
    progress: called on this thread as progress(stage, fraction), or progress(stage, fraction, overall) if it has three
    parameters without a default; overall is the fraction of the whole call, by expected time, and ends at 1. Only a
    return value of False cancels, with a CancelledError. Exceptions are passed on. Ctrl-C raises KeyboardInterrupt.

    >>> scene = open_scene("my-car")
    >>> made = reconstruct(scene.images, scene.masks, scene.cameras, scene.depths, names=scene.names)
    >>> made.gaussians.save_ply("car.ply")
    >>> made.report["prior"]
    'given'
    """
    gaussians, report, lifted = _native.reconstruct(
        listed(images, "images", 3),
        None if masks is None else listed(masks, "masks", 2),
        listed(cameras, "cameras"),
        None if depths is None else listed(depths, "depths", 2),
        options={
            "prior": prior,
            "calibrate": calibrate,
            "symmetry": symmetry,
            "relight": relight,
            "sh_degree": sh_degree,
            "keep": [keep] if isinstance(keep, str) else listed(keep, "keep"),
            "check": check,
            "photo": photo,
            "budget": budget,
            "resolution": resolution,
            "max_views": max_views,
            "max_gaussians": max_gaussians,
            "points": points,
        },
        prior_model=prior_model,
        head_model=head_model,
        cloud=cloud,
        vehicle_size=vehicle_size,
        vehicle_place=vehicle_place,
        refine_iterations=refine_iterations,
        refine_seconds=refine_seconds,
        refine_hold_out=refine_hold_out,
        refine_backend=refine_backend,
        threads=threads,
        names=None if names is None else listed(names, "names"),
        progress=progress,
    )
    document = json.loads(report)
    reconstructed(document)
    return Reconstruction(gaussians, document, None if lifted is None else Points(*lifted))
