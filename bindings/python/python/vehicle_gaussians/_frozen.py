"""Arrays over memory that must not change."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class FrozenArray(np.ndarray[Any, Any]):
    """A read-only view of the library's memory, which it keeps alive.

    Consumers of DLPack may ignore the read-only flag, so they get a copy; a request without a copy is an error.
    Results of computations, copies and pickles are ordinary arrays.
    """

    def __dlpack__(self, **how: Any) -> Any:
        if self.flags.writeable or how.get("copy"):
            return np.asarray(self).__dlpack__(**how)
        if how.pop("copy", None) is False:
            raise BufferError("copy=False: read-only memory of vehicle_gaussians is exported as a copy; use copy=None")
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
