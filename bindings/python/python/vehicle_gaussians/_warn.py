"""Warnings about legal input that looks like a mistake, and the logger ``vehicle_gaussians``."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

#: Logger of the library. Without a handler of the host program it prints nothing, because warnings are issued anyway.
LOGGER = logging.getLogger("vehicle_gaussians")
LOGGER.addHandler(logging.NullHandler())

_PACKAGE = str(Path(__file__).parent)


class VgWarning(UserWarning):
    """A warning about legal input that looks like a mistake, or about a request that could not be met."""


def warn(text: str) -> None:
    """Issues a warning at the line that called the package, and logs it."""
    LOGGER.warning("%s", text)
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, VgWarning, stacklevel=level)


def reconstructed(report: Mapping[str, Any]) -> None:
    """Logs a reconstruction's omissions and times, and issues its warnings."""
    for left in report["left_out"]:
        LOGGER.info("left out %d %s: %s", left["count"], left["what"], left["why"])
    for stage in report["stages"]:
        LOGGER.debug("%s: %.1f ms", stage["name"], stage["ms"])
    taken = (report["gaussians"], report["prior"], report["total_ms"])
    LOGGER.info("%d Gaussians from depth prior %s in %.1f ms", *taken)
    for text in (*report["warnings"], *(report["network"] or {"warnings": ()})["warnings"]):
        warn(text)
    for reason in report.get("verdict_reasons", ()):
        view = "" if reason["view"] is None else f"view {reason['view']}: "
        warn(
            f"{report['verdict']}: {view}{reason['found']}; expected: {reason['expected']}; "
            f"likely cause: {reason['cause']}; {reason['remedy']}"
        )
