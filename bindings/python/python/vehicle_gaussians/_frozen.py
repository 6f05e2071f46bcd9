"""Arrays over memory that must not change."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class FrozenArray(np.ndarray[Any, Any]):
    """A read-only view of the library's memory, which it keeps alive.

    DLPack's readers may pass over the flag that says so: they are given a copy, and refused one that must not be.
    What is computed from it, copied or pickled, is an ordinary array.
    """

    def __dlpack__(self, **how: Any) -> Any:
        if self.flags.writeable or how.get("copy"):
            return np.asarray(self).__dlpack__(**how)
        if how.pop("copy", None) is False:
            raise BufferError("read-only memory of vehicle_gaussians is not handed out without a copy: copy=None")
        return np.array(self).__dlpack__(**how)

    def __array_wrap__(self, array: npt.NDArray[Any], context: Any = None, return_scalar: bool = False) -> Any:
        plain = np.asarray(array)
        return plain[()] if plain.ndim == 0 else plain

    def copy(self, order: Any = "C") -> Any:
        return np.array(self, order=order)

    def __copy__(self) -> Any:
        return np.array(self)

    def __deepcopy__(self, memo: dict[int, Any] | None, /) -> Any:
        return np.array(self)

    def __reduce_ex__(self, protocol: Any) -> Any:
        return np.asarray(self).__reduce_ex__(protocol)
