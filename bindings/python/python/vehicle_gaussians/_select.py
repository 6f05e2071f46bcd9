"""Conversion of NumPy's indices to whole numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import bad_type, bad_value


def indices(index: Any, n: int) -> npt.NDArray[np.int64]:
    """Items of n that an index selects: a slice, or an array of n bools or of whole numbers, negative from the end."""
    allowed = f"a slice, {n} bools, or whole numbers"
    if isinstance(index, slice):
        return np.arange(n, dtype=np.int64)[index]
    try:
        array = np.asarray(index)
    except ValueError:
        raise bad_type("index", index, allowed) from None
    if array.size == 0 and array.ndim == 1:
        return np.empty(0, np.int64)
    if array.ndim == 0 or array.dtype.kind not in "bui":
        way_out = "; of one Gaussian [i]" if array.ndim == 0 and array.dtype.kind in "ui" else ""
        raise bad_type("index", index, allowed + way_out)
    if array.ndim != 1:
        raise bad_value("index", f"shape {array.shape}", "one dimension")
    if array.dtype == np.bool_:
        if len(array) != n:
            raise bad_value("index", f"{len(array)} bools", f"{n}, one for each Gaussian")
        return np.flatnonzero(array)
    outside = np.flatnonzero((array < -n) | (array >= n))
    if len(outside):
        raise bad_value(f"index[{outside[0]}]", array[outside[0]], f"{-n} to {n - 1}")
    return np.where(array < 0, array + n, array).astype(np.int64)
