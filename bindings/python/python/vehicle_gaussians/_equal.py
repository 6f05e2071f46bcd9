"""Equality of objects that hold arrays, because NumPy's ``==`` returns an array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def equal_by_value(cls: type[T]) -> type[T]:
    """Makes objects of a class equal if they hold the same values; a named tuple also equals a plain tuple."""

    def parts(thing: Any) -> tuple[Any, ...]:
        return tuple(thing) if isinstance(thing, tuple) else tuple(vars(thing).values())

    def __eq__(self: T, other: object) -> bool:
        alike = isinstance(other, cls) or (isinstance(self, tuple) and isinstance(other, tuple))
        return equal(parts(self), parts(other)) if alike else NotImplemented

    def __ne__(self: T, other: object) -> bool:
        same = __eq__(self, other)
        return same if same is NotImplemented else not same

    for name, method in ("__eq__", __eq__), ("__ne__", __ne__), ("__hash__", None):
        setattr(cls, name, method)
    return cls


def equal(a: Any, b: Any) -> bool:
    """Whether both hold the same values: arrays of one dtype and shape, lists and mappings entry by entry."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return False
    for kind in (tuple, list):
        if isinstance(a, kind) and isinstance(b, kind):
            return len(a) == len(b) and all(equal(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    return bool(a == b)
