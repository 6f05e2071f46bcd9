"""Result of an alignment."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ._documented import documented
from ._equal import equal_by_value


@equal_by_value
@documented
class Alignment(NamedTuple):
    """A similarity from a world of any gauge to the vehicle's frame, and how well it fits."""

    vehicle_from_world: npt.NDArray[np.float64]
    """Row-major (4, 4), metres, as ``open_scene`` and ``Camera`` take it."""
    scale: float
    """Metres per unit of the world."""
    residual_m: float
    """Typical distance between things that should coincide, metres."""
    confidence: float
    """0 to 1; 0 if another solution fits equally well."""
    residual_px: float | None
    """Mean distance between the outlines of scan and masks, pixels; None without a scan."""
    other_px: float | None
    """That distance with front and back exchanged."""
    used_count: int
    """Number of views, or points, that the similarity was found from."""
    kept: npt.NDArray[np.bool_] | None = None
    """Which points were used, bool (n,); None for alignments without point pairs."""
    residuals_m: npt.NDArray[np.float64] | None = None
    """Distance of each mapped point from its measured position, metres, float64 (n,)."""
