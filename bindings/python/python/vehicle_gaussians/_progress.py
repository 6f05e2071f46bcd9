"""Progress functions: their arguments and the meaning of their return values."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeAlias

#: Called as ``progress(stage, fraction)``, or as ``progress(stage, fraction, overall)`` if it has three parameters
#: without a default.
Progress: TypeAlias = Callable[[str, float], object] | Callable[[str, float, float], object]


def wrapped(progress: Progress) -> Callable[[str, float, float], bool]:
    """Wraps a progress function as a function of stage, fraction and overall fraction that returns whether to go on.

    Only ``False`` itself cancels: progress bars and streams return None, a number, or True (``tqdm.update``), and a
    NumPy object is not meant as an answer.
    """
    function: Callable[..., object] = progress
    if not callable(progress):
        raise TypeError(f"progress: {type(progress).__name__}; allowed: a function, or None")
    if _has_three_parameters(function):
        return lambda stage, fraction, overall: function(stage, fraction, overall) is not False
    return lambda stage, fraction, _: function(stage, fraction) is not False


def _has_three_parameters(function: Callable[..., object]) -> bool:
    """Whether the function has three parameters without a default; others are the caller's own."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        # Functions that are not written in Python may have no signature.
        return False
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.kind in positional and p.default is inspect.Parameter.empty for p in parameters) == 3
