"""What an alignment comes back as."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Alignment(NamedTuple):
    """A similarity from a world of any gauge to the vehicle's frame, and how well it fits."""

    #: Row-major (4, 4), metres, as ``open_scene`` and ``Camera`` take it.
    vehicle_from_world: npt.NDArray[np.float64]
    #: Metres per unit of the world.
    scale: float
    #: Typical distance of what should coincide, metres.
    residual_m: float
    #: 0 to 1; at 0 another answer fits as well.
    confidence: float
    #: Mean distance between the outlines of scan and masks, pixels; None without a scan.
    residual_px: float | None
    #: The same with front and back exchanged.
    other_px: float | None
    #: Views, or points, that the similarity was found from.
    used_count: int
    #: Which points were used, bool (n,); None where there were none to choose from.
    kept: npt.NDArray[np.bool_] | None = None
    #: How far each point ends from its place, float64 (n,).
    residuals_m: npt.NDArray[np.float64] | None = None
