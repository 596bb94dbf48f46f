"""What every check gives: sentences about a run, and what they add to its uncertainties."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pipeline.registry.findings import Severity, check_finding
from pipeline.registry.quantities import check_input

__all__ = ["GRAVITY_M_PER_S2", "Checked", "Finding", "Misfit", "Severity", "by_severity"]

GRAVITY_M_PER_S2 = 9.81


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence about a run.

    Parameters
    ----------
    code : str
        One of :data:`pipeline.registry.findings.FINDINGS`.
    severity : {"info", "warning", "error"}
        An error means that a number of the result must not be used.
    message : str

    Raises
    ------
    ValueError
        If the code is not registered with this severity.
    """

    code: str
    severity: Severity
    message: str

    def __post_init__(self) -> None:
        check_finding(self.code, self.severity)


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """What the estimates may be off by, because the model does not hold as the fit takes for granted.

    Parameters
    ----------
    name : str
        Of the input in every budget, one of :data:`pipeline.registry.quantities.INPUTS`.
    amplitude_m, offset_m, phase_rad, damping_rate : float
        Standard uncertainties that it adds to the estimates of these names, m, m, rad, 1/s.
    clock : float
        Relative standard uncertainty that it adds to all that is measured by the record's times.

    Raises
    ------
    ValueError
        If the name is not registered.
    """

    name: str
    amplitude_m: float = 0.0
    offset_m: float = 0.0
    phase_rad: float = 0.0
    damping_rate: float = 0.0
    clock: float = 0.0

    def __post_init__(self) -> None:
        check_input(self.name)


@dataclass(frozen=True, slots=True)
class Checked:
    """What a record says against its own model.

    Parameters
    ----------
    findings : tuple of Finding
    misfits : tuple of Misfit
        What enters the uncertainties.
    """

    findings: tuple[Finding, ...] = ()
    misfits: tuple[Misfit, ...] = ()

    @classmethod
    def together(cls, *each: Checked) -> Checked:
        """Return what several checks say, in their order."""
        return cls(tuple(f for one in each for f in one.findings), tuple(m for one in each for m in one.misfits))


def by_severity(*groups: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return all findings, the gravest first, else in their order."""
    rank = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted((one for group in groups for one in group), key=lambda finding: rank[finding.severity]))
