"""Conversion of Python arguments, with errors that name the argument, for both interfaces."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import ArgumentTypeError, Status, VgError


def bad_type(argument: str, found: Any, allowed: str) -> ArgumentTypeError:
    """The error of an argument of the wrong kind."""
    kind = f"array of {found.dtype}" if isinstance(found, np.ndarray) else type(found).__name__
    return ArgumentTypeError(Status.ARGUMENT, f"{argument}: {kind}; allowed: {allowed}")


def bad_value(argument: str, found: object, allowed: str) -> VgError:
    """The error of an argument of the right kind with a value that is not accepted."""
    return VgError(Status.ARGUMENT, f"{argument}: {found}; allowed: {allowed}")


def listed(entries: Iterable[Any], argument: str, entry_dimensions: int = 0) -> list[Any]:
    """The entries of a list; one entry alone, such as an array of ``entry_dimensions``, is an error."""
    if isinstance(entries, np.ndarray) and entries.ndim <= entry_dimensions:
        allowed = f"a list with an entry for each view; of one view [{argument.removesuffix('s')}]"
        raise ArgumentTypeError(Status.ARGUMENT, f"{argument}: one array, shape {entries.shape}; allowed: {allowed}")
    if not isinstance(entries, (str, bytes)):
        try:
            return list(entries)
        except TypeError as error:
            if hasattr(entries, "__iter__"):
                raise
            raise bad_type(argument, entries, "a list with an entry for each view") from error
    raise bad_type(argument, entries, "a list with an entry for each view")


def whole(number: Any, argument: str, lowest: int, highest: int, allowed: str | None = None) -> int:
    """A whole number from ``lowest`` to ``highest``."""
    allowed = allowed or f"{lowest} to {highest}"
    try:
        value = operator.index(number)
    except TypeError:
        raise bad_type(argument, number, f"a whole number, {allowed}") from None
    if not lowest <= value <= highest:
        raise bad_value(argument, value, allowed)
    return value


def real(number: Any, argument: str) -> float:
    """A number."""
    try:
        return float(number)
    except (TypeError, ValueError, OverflowError):
        raise bad_type(argument, number, "a number") from None


def floats(array: Any, argument: str, allowed: str) -> npt.NDArray[np.float32]:
    """An array of float32. Floats of any precision are rounded. Whole numbers are accepted in a list but not in an
    array, where they often have another unit."""
    try:
        found = np.asarray(array)
    except ValueError:
        raise bad_type(argument, array, allowed) from None
    if found.dtype.kind == "f" or (isinstance(array, (list, tuple)) and found.dtype.kind in "iu"):
        return found.astype(np.float32, copy=False)
    raise bad_type(argument, found if isinstance(array, np.ndarray) else array, allowed)


def doubles(values: Any, argument: str, shape: tuple[int, ...] | None = None) -> npt.NDArray[np.float64]:
    """Numbers in row order, of this shape if it is given."""
    try:
        found = np.asarray(values)
        # NumPy would read text as numbers, and drop the imaginary part of complex ones.
        if found.dtype.kind not in "biufO":
            raise bad_type(argument, values, "numbers")
        array = np.ascontiguousarray(found, dtype=np.float64)
    except (TypeError, ValueError):
        raise bad_type(argument, values, "numbers") from None
    if shape is not None and array.shape != shape:
        raise bad_value(argument, f"shape {array.shape}", f"{shape}")
    return array


def pose(matrix: Any, argument: str) -> npt.NDArray[np.float64]:
    """A rigid transform, 3x4 or 4x4."""
    array = doubles(matrix, argument)
    if array.shape not in ((3, 4), (4, 4)):
        raise bad_value(argument, f"shape {array.shape}", "a 3x4 or 4x4 matrix")
    if array.shape == (4, 4) and array[3].tolist() != [0, 0, 0, 1]:
        raise bad_value(argument, f"last row {array[3].tolist()}", "0 0 0 1")
    return array
