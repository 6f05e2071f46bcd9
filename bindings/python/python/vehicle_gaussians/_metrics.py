"""Errors of a model against photographs and against a scan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._measures import PictureErrors, SurfaceErrors, ViewErrors
from ._pictures import in_range
from ._types import Floats

if TYPE_CHECKING:
    from ._native import Camera, Gaussians, Model


def picture_errors(
    a: npt.NDArray[Any],
    b: npt.NDArray[Any],
    *,
    data_range: float | None = None,
    lpips: Model | None = None,
    threads: int = 0,
) -> PictureErrors:
    """Measures the difference of two pictures of one size, uint8 or floats in [0, 1], (height, width, 3 or 4).

    Transparent parts are composited on white. data_range: the value of white in both, if it is not 255 in bytes or 1 in
    floats; floats that are more than 1 beyond their range are an error, because clamping would make them equal.
    lpips: a network that measures LPIPS, made by ``python -m vehicle_gaussians.export.lpips``.
    threads: worker threads; 0 means one per core.

    >>> picture_errors(image, image).psnr_db
    inf
    """
    return PictureErrors(*_native.picture_errors(in_range(a, data_range), in_range(b, data_range), lpips, threads))


def view_errors(
    gaussians: Gaussians,
    image: npt.NDArray[np.uint8],
    mask: npt.NDArray[Any] | None,
    camera: Camera,
    depth: Floats | None = None,
    *,
    lpips: Model | None = None,
    threads: int = 0,
) -> ViewErrors:
    """Measures the error of a model, drawn on white, against one photograph, which its mask composites on white.

    The picture, mask, camera and depth are as for ``reconstruct``; lpips and threads as for ``picture_errors``.

    >>> view_errors(car, image, mask, camera).silhouette_iou > 0.8
    True
    """
    errors = _native.view_errors(gaussians, image, mask, camera, depth, lpips, threads)
    return ViewErrors(**errors)  # type: ignore[arg-type]


def surface_errors(gaussians: Gaussians, points: Floats, *, f_score: float = 0.05, threads: int = 0) -> SurfaceErrors:
    """Measures the error of a model's surface against points on the vehicle: floats (n, 3), metres, its frame.

    f_score: the distance below which a point counts as correct, metres. threads: as for ``picture_errors``.

    >>> surface_errors(car, scan).accuracy_m < 0.1
    True
    """
    errors = _native.surface_errors(gaussians, points, f_score, threads)
    return SurfaceErrors(**errors)  # type: ignore[arg-type]
