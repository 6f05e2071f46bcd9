"""Photographs in memory to a vehicle."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _native
from ._native import Camera, Gaussians, Model

#: Masks are bool, or uint8 where 128 and above is vehicle.
Mask: TypeAlias = npt.NDArray[np.bool_] | npt.NDArray[np.uint8]


class Points(NamedTuple):
    """The metric coloured point cloud: a point for every vehicle pixel with depth."""

    #: Metres, vehicle frame; float32 (n, 3).
    positions: npt.NDArray[np.float32]
    #: sRGB; uint8 (n, 3).
    colors: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Reconstruction:
    """A finished reconstruction."""

    #: The vehicle.
    gaussians: Gaussians
    #: What was done, how long it took, what was left out and why.
    report: dict[str, Any]
    #: The point cloud, if asked for.
    points: Points | None


def reconstruct(
    images: Iterable[npt.NDArray[np.uint8]],
    masks: Iterable[Mask | None] | None,
    cameras: Iterable[Camera],
    depths: Iterable[npt.NDArray[np.float32] | None] | None = None,
    *,
    prior: Literal["auto", "given", "hull", "shape", "onnx"] = "auto",
    prior_model: Model | None = None,
    head_model: Model | None = None,
    calibrate: Literal["auto", "off"] = "auto",
    symmetry: Literal["auto", "always", "never", "flip"] = "auto",
    relight: Literal["auto", "never"] = "auto",
    photo: bool = True,
    cloud: npt.NDArray[np.float32] | None = None,
    vehicle_size: tuple[float, float, float] | None = None,
    sh_degree: int = 2,
    keep: str | Iterable[str] = (),
    check: bool = True,
    points: bool = False,
    budget: float | None = None,
    resolution: float = 1.0,
    max_views: int | None = None,
    max_gaussians: int | None = 12_000_000,
    refine_iterations: int | None = None,
    refine_seconds: float | None = None,
    refine_hold_out: bool = False,
    refine_backend: Literal["auto", "cpu", "gpu"] = "auto",
    threads: int = 0,
    names: Iterable[str] | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> Reconstruction:
    """Reconstructs the vehicle that the photographs show.

    images: RGB, uint8 (height, width, 3); with a fourth channel, alpha is the mask where none is given.
    masks: (height, width), bool or uint8 where 128 and above is vehicle; None where nobody said.
    cameras: one per image, posed in the vehicle's frame (x forward, y left, z up, metres; y = 0 is the plane of
    symmetry).
    depths: float32 (height, width), metres along the optical axis, 0 for none.
    prior: "given" takes the depths, "hull" the silhouettes, "shape" the silhouettes and what vehicles look like,
    "onnx" the network prior_model; "auto" the depths if every used view has them, else "shape".
    prior_model, head_model: networks that tell depth, and that make Gaussians of pixels.
    calibrate: correct cameras and the plane of symmetry where the silhouettes contradict them ("auto"), or take them
    as they are ("off").
    symmetry: mirror what no view observed ("auto"), all of the denser side ("always"), nothing ("never"), or the
    photographs instead of the model ("flip").
    relight: show mirror images in the light of their own side ("auto"), or as they were seen ("never").
    photo: whether prior "shape" moves its surface to where the photographs agree.
    cloud: points measured on the vehicle, float32 (n, 3), metres, vehicle frame, all finite; some may be wrong or show
    something else. Priors "shape" and "hull" bend their surface to them.
    vehicle_size: length, width, height in metres, where known.
    sh_degree: highest degree of the colour, 0 to 3.
    keep: what may not be left out as not needed: "duplicate-views", "overlap", "silhouette-edge", "floaters",
    "sh-bands", or "all".
    check: draw the model into its input views for the report.
    points: return the point cloud as well.
    budget: seconds the call may take, where that matters; what is left out is then chosen to fit.
    resolution: the share of their width and height to which the views are resampled first, above 0, at most 1; a budget
    may choose less.
    max_views: use at most this many views, those that spread best around the vehicle; a budget may choose fewer.
    max_gaussians: most Gaussians that the model may have by what the masks say of its size; where they allow for more,
    the views are resampled to fewer pixels, and the report's left_out says so. None: any number.
    refine_iterations, refine_seconds: optimise the model against the photographs, by so many steps, or by as many as fit
    into about so many seconds; the report tells how many that were. Beside a budget, not within it.
    refine_hold_out: one of three or more views takes no part in that and tells when to stop.
    refine_backend: who draws and goes back in it; "auto" is what is known to pay, at present the processor.
    threads: worker threads; 0 means one per core. The result is the same with any number.
    names: of the views, for messages and the report.
    progress: called as progress(stage, fraction) on this thread; a true return value cancels (a VgError with code
    CANCELLED), an exception passes through. Ctrl-C raises KeyboardInterrupt at the next call.
    """
    gaussians, report, lifted = _native.reconstruct(
        list(images),
        None if masks is None else list(masks),
        list(cameras),
        None if depths is None else list(depths),
        prior=prior,
        prior_model=prior_model,
        head_model=head_model,
        calibrate=calibrate,
        symmetry=symmetry,
        relight=relight,
        photo=photo,
        cloud=cloud,
        vehicle_size=None if vehicle_size is None else list(vehicle_size),
        sh_degree=sh_degree,
        keep=[keep] if isinstance(keep, str) else list(keep),
        check=check,
        points=points,
        budget=budget,
        resolution=resolution,
        max_views=max_views,
        max_gaussians=max_gaussians,
        refine_iterations=refine_iterations,
        refine_seconds=refine_seconds,
        refine_hold_out=refine_hold_out,
        refine_backend=refine_backend,
        threads=threads,
        names=None if names is None else list(names),
        progress=progress,
    )
    return Reconstruction(gaussians, json.loads(report), None if lifted is None else Points(*lifted))
