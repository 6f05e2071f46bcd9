"""What is legal but looks like a mistake."""

from __future__ import annotations

import warnings
from typing import Any

#: The line that called reconstruct.
_CALLER = 3


class VgWarning(UserWarning):
    """Something is legal, but looks like a mistake: a result that is not to be believed, for one."""


def warn_of_verdict(report: dict[str, Any]) -> None:
    """Warns of each reason why the verdict of a report is not good."""
    for reason in report["verdict_reasons"]:
        view = "" if reason["view"] is None else f"view {reason['view']}: "
        warnings.warn(
            f"{report['verdict']}: {view}{reason['found']}; expected: {reason['expected']}; "
            f"likely cause: {reason['cause']}; {reason['remedy']}",
            VgWarning,
            stacklevel=_CALLER,
        )
