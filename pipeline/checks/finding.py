"""One sentence about a run: what every check and every judgement gives."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

__all__ = ["GRAVITY_M_PER_S2", "Finding", "Severity", "by_severity"]

GRAVITY_M_PER_S2 = 9.81

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence about a run.

    Parameters
    ----------
    code : str
        From the closed list of the program's findings.
    severity : {"info", "warning", "error"}
        An error means that a number of the result must not be used.
    message : str
    """

    code: str
    severity: Severity
    message: str


def by_severity(*groups: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return all findings, the gravest first, else in their order."""
    rank = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted((one for group in groups for one in group), key=lambda finding: rank[finding.severity]))
