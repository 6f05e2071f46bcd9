"""What a loss looks at, and what its gradients come back as."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ._documented import documented
from ._equal import equal_by_value


@equal_by_value
@documented
class Planes(NamedTuple):
    """A picture as losses look at it: float32 and not rounded."""

    color: npt.NDArray[np.float32]
    """sRGB-encoded, over the background; premultiplied by alpha where that is transparent. (height, width, 3)"""
    alpha: npt.NDArray[np.float32]
    """How much of the pixel the vehicle covers, 0 to 1, whatever the background. (height, width)"""
    depth: npt.NDArray[np.float32]
    """Metres along the optical axis, 0 where there is nothing. (height, width)"""


@equal_by_value
@documented
class Gradients(NamedTuple):
    """Gradients of a loss with respect to everything a picture is made of; arrays as those of Gaussians."""

    means: npt.NDArray[np.float32]
    """Per metre, float32 (n, 3)."""
    scales: npt.NDArray[np.float32]
    """Of standard deviations, per metre, float32 (n, 3)."""
    quats: npt.NDArray[np.float32]
    """Of the stored unit quaternions as four numbers that are normalised before use, perpendicular to them; who handed
    in a quaternion of another norm divides by that norm. float32 (n, 4)"""
    opacities: npt.NDArray[np.float32]
    """float32 (n,)."""
    sh: npt.NDArray[np.float32]
    """float32 (n, (degree + 1)^2, 3)."""
    background: npt.NDArray[np.float64]
    """Of the background colour; zero for a transparent one. float64 (3,)"""
    pose: npt.NDArray[np.float64]
    """Of the camera's place: turned about its own axes, per radian, then moved along them, per metre. float64 (6,)"""
    view_matrix: npt.NDArray[np.float64]
    """Of the entries of camera_from_vehicle, all free. float64 (4, 4)"""
