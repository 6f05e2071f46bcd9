"""What a progress function is told, and what its answer means."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeAlias

#: Called as ``progress(stage, fraction)``, or as ``progress(stage, fraction, overall)`` if it has three parameters
#: that must be given.
Progress: TypeAlias = Callable[[str, float], object] | Callable[[str, float, float], object]


def teller(progress: Progress) -> Callable[[str, float, float], bool]:
    """Tells a progress function the stage, the part of it that is done and the part of all; whether to go on.

    Only ``False`` itself stops: what bars and streams return of their own accord is None, a number, or True
    (``tqdm.update``), and an object of NumPy is not meant for an answer.
    """
    function: Callable[..., object] = progress
    if not callable(progress):
        raise TypeError(f"progress: {type(progress).__name__}; allowed: a function, or None")
    if _has_three_parameters(function):
        return lambda stage, fraction, overall: function(stage, fraction, overall) is not False
    return lambda stage, fraction, _: function(stage, fraction) is not False


def _has_three_parameters(function: Callable[..., object]) -> bool:
    """Of those with a default value, the third is the caller's own."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        # Of a function that is not written in Python there may be none.
        return False
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return sum(p.kind in positional and p.default is inspect.Parameter.empty for p in parameters) == 3
