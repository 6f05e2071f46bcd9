"""Pictures for losses, and gradients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ._documented import documented
from ._equal import equal_by_value


@equal_by_value
@documented
class Planes(NamedTuple):
    """A picture for use in a loss: float32 and not rounded."""

    color: npt.NDArray[np.float32]
    """sRGB-encoded, over the background; premultiplied by alpha where that is transparent. (height, width, 3)"""
    alpha: npt.NDArray[np.float32]
    """Coverage of the pixel by the vehicle, 0 to 1, for any background. (height, width)"""
    depth: npt.NDArray[np.float32]
    """Metres along the optical axis, 0 where there is no Gaussian. (height, width)"""


@equal_by_value
@documented
class Gradients(NamedTuple):
    """Gradients of a loss with respect to all inputs of a picture; arrays have the shapes of those of Gaussians."""

    means: npt.NDArray[np.float32]
    """Gradient of centres, per metre, float32 (n, 3)."""
    scales: npt.NDArray[np.float32]
    """Gradient of standard deviations, per metre, float32 (n, 3)."""
    quats: npt.NDArray[np.float32]
    """Gradient of the stored unit quaternions as four numbers that are normalised before use, perpendicular to them;
    for a quaternion that was given with another norm, divide by that norm. float32 (n, 4)"""
    opacities: npt.NDArray[np.float32]
    """Gradient of peak opacities, float32 (n,)."""
    sh: npt.NDArray[np.float32]
    """Gradient of spherical harmonics, float32 (n, (degree + 1)^2, 3)."""
    background: npt.NDArray[np.float64]
    """Gradient of the background colour; zero for a transparent one. float64 (3,)"""
    pose: npt.NDArray[np.float64]
    """Gradient of the camera's pose: rotation about its axes, per radian, then translation, per metre. float64 (6,)"""
    view_matrix: npt.NDArray[np.float64]
    """Gradient of the entries of camera_from_vehicle, all treated as independent. float64 (4, 4)"""
