"""Pictures with other ranges than 0 to 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import bad_value


def in_range(picture: Any, data_range: float | None) -> Any:
    """The picture divided by its range, the value of white. Without a range, white is 255 in bytes and 1 in floats."""
    if data_range is None:
        return picture
    if not 0 < data_range < float("inf"):
        raise bad_value("data_range", data_range, "above 0: the value of white in both pictures")
    array: npt.NDArray[Any] = np.asarray(picture)
    if array.dtype.kind not in "buif":
        # The caller reports the error.
        return picture
    return (array / data_range).astype(np.float32)
