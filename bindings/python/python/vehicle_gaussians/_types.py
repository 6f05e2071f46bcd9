"""Types of arguments: the values of options, and kinds of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

#: Renderer.
Backend: TypeAlias = Literal["auto", "cpu", "gpu"]
#: Background: a name, or (r, g, b) from 0 to 1.
Background: TypeAlias = Literal["white", "black", "transparent"] | Sequence[float] | npt.NDArray[Any]
#: Whether cameras and the plane of symmetry are corrected.
Calibrate: TypeAlias = Literal["auto", "off"]
#: Depth in metres along the axis, or depth times alpha.
DepthMode: TypeAlias = Literal["expected", "accumulated"]
#: End of the vehicle that the first view shows.
Heading: TypeAlias = Literal["auto", "forward", "backward"]
#: Omissions that must not be made.
Keep: TypeAlias = Literal["duplicate-views", "overlap", "silhouette-edge", "floaters", "sh-bands", "all"]
#: Source of depth.
Prior: TypeAlias = Literal["auto", "given", "hull", "shape", "onnx"]
#: Whether mirror images are relit.
Relight: TypeAlias = Literal["auto", "never"]
#: Parts that are mirrored.
Symmetry: TypeAlias = Literal["auto", "always", "never", "flip"]

#: Floats of any precision, which the library rounds to float32.
Floats: TypeAlias = npt.NDArray[np.floating[Any]] | Sequence[Any]
#: Mask of the vehicle: bool, or uint8 where 128 and above is vehicle.
Mask: TypeAlias = npt.NDArray[np.bool_] | npt.NDArray[np.uint8]
#: Three lengths, metres: length, width, height.
Size: TypeAlias = Sequence[float] | npt.NDArray[Any]
#: Pose of a box: x, y, z of its centre, metres, and its rotation about z, radians.
Placed: TypeAlias = Sequence[float] | npt.NDArray[Any]
