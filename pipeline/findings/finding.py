"""A finding about a run: one sentence, what to do, and the numbers behind it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from pipeline.findings.registry import FINDINGS, Severity, check_finding

__all__ = ["Finding", "Severity", "by_severity"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding about a run.

    Parameters
    ----------
    code : str
        One of :data:`pipeline.findings.registry.FINDINGS`.
    severity : {"info", "warning", "error"}
        An error means that a number of the result must not be used.
    message : str
        One sentence that a first-year student understands, with the number that matters.
    details : str
        Statistics, alternatives and method, for readers who want more.
    values : mapping of str to float
        The numbers in SI units; their names include the units.
    advice : str
        What to do; by default the advice in the registry. A note (severity "info") has none by default.

    Raises
    ------
    ValueError
        If the code is not registered with this severity.
    """

    code: str
    severity: Severity
    message: str
    details: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    advice: str = ""

    def __post_init__(self) -> None:
        check_finding(self.code, self.severity)
        if not self.advice and self.severity != "info":
            object.__setattr__(self, "advice", FINDINGS[self.code].advice)


def by_severity(*groups: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return all findings sorted by severity, the most severe first; findings of equal severity keep their order."""
    rank = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted((one for group in groups for one in group), key=lambda finding: rank[finding.severity]))
