"""Types of arguments: the words that options take, and arrays of what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

#: Who draws.
Backend: TypeAlias = Literal["auto", "cpu", "gpu"]
#: What is behind the vehicle: a name, or (r, g, b) from 0 to 1.
Background: TypeAlias = Literal["white", "black", "transparent"] | Sequence[float] | npt.NDArray[Any]
#: Whether cameras and the plane of symmetry are corrected.
Calibrate: TypeAlias = Literal["auto", "off"]
#: Metres along the axis, or that times alpha.
DepthMode: TypeAlias = Literal["expected", "accumulated"]
#: Which end of the vehicle the first view shows.
Heading: TypeAlias = Literal["auto", "forward", "backward"]
#: What may not be left out as not needed.
Keep: TypeAlias = Literal["duplicate-views", "overlap", "silhouette-edge", "floaters", "sh-bands", "all"]
#: Where depth comes from.
Prior: TypeAlias = Literal["auto", "given", "hull", "shape", "onnx"]
#: In which light mirror images are shown.
Relight: TypeAlias = Literal["auto", "never"]
#: What is mirrored.
Symmetry: TypeAlias = Literal["auto", "always", "never", "flip"]

#: Floats of any precision, which the library rounds to float32.
Floats: TypeAlias = npt.NDArray[np.floating[Any]] | Sequence[Any]
#: Vehicle or not: bool, or uint8 where 128 and above is vehicle.
Mask: TypeAlias = npt.NDArray[np.bool_] | npt.NDArray[np.uint8]
#: Three lengths, metres: length, width, height.
Size: TypeAlias = Sequence[float] | npt.NDArray[Any]
#: Where a box stands: x, y, z of its centre, metres, and its turn about z, radians.
Placed: TypeAlias = Sequence[float] | npt.NDArray[Any]
