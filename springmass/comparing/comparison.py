"""Compare several runs of one spring: the result for scripts, commands and reports, and its JSON."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NotRequired, TypedDict

from pipeline.analyse import Oscillation
from pipeline.errors import AnalysisError
from pipeline.findings.finding import Finding, by_severity, word
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.results.derive import limited
from pipeline.several.compare import Comparison, SpringRun, compare_springs
from pipeline.several.joint import JointDamping, JointFit, join
from pipeline.several.masses import Hooke, MassLine, mass_line
from springmass.comparing.reported import Reported, judge, read_reported
from springmass.comparing.user_table import read_hooke
from springmass.errors import ProgramError
from springmass.result.frames import comparison_frame
from springmass.result.run_json import (
    RESULT_SCHEMA,
    Parameter,
    Provenance,
    RunResult,
    fields_of,
    parameters_json,
    plain,
)
from springmass.runs.run import Run

if TYPE_CHECKING:
    import pandas as pd


class OfRun(TypedDict):
    """One run of a comparison."""

    name: str
    period: Estimate
    mass: Estimate
    spring_constant: Estimate
    u_own: float
    pull: float


class Springs(TypedDict):
    """The comparison of the spring constants."""

    agree: bool
    spring_constant: Estimate | None
    spring_mass: Estimate | None
    spring_mass_stated: bool
    chi2: float
    dof: int
    largest_deviation: float
    exchanged: Sequence[str]
    exchanged_chi2: float | None
    message: str
    each: Sequence[OfRun]


class JointLaw(TypedDict):
    """The fit of one law with common coefficients."""

    parameters: Mapping[str, Parameter]
    reduced_chi2: float
    dof: float
    bic: float
    excess_chi2: float
    excess_dof: float
    rejection: str


class JointLaws(TypedDict):
    """The fits of the laws to the runs of one bob and disc."""

    runs: Sequence[str]
    one_law: bool
    selected: str
    admissible: Sequence[str]
    message: str
    laws: Mapping[str, JointLaw]


class LineOfMasses(TypedDict):
    """The line through the squared periods of several masses."""

    constant: Estimate
    effective_mass: Estimate
    chi2: float
    dof: int


class HookesLaw(TypedDict):
    """The spring constant by Hooke's law."""

    constant: Estimate
    normalised_error: float | None


class ComparisonResult(TypedDict):
    """The result of a comparison."""

    schema: Literal[3]
    comparison: Springs
    joint_damping: Sequence[JointLaws]
    findings: Sequence[Finding]
    mass_line: NotRequired[LineOfMasses]
    hooke: NotRequired[HookesLaw]
    reported: NotRequired[Sequence[Reported]]
    runs: Sequence[RunResult]
    provenance: Provenance


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SpringComparison:
    """The joint result of several runs of one spring, as :func:`springmass.compare` returns it.

    Parameters
    ----------
    comparison : Comparison
        Comparison of their spring constants.
    joint : tuple of JointDamping
        Joint damping fit for each bob that several runs have in common.
    findings : tuple of Finding
        The most severe first.
    runs : mapping of str to Run
    reported : tuple of Reported
        Values that somebody printed, each with its verdict.
    line : MassLine or None
        Line through the squared periods of three or more bobs of different mass.
    hooke : Hooke or None
        The spring constant by Hooke's law.
    """

    comparison: Comparison
    joint: tuple[JointDamping, ...]
    findings: tuple[Finding, ...]
    runs: Mapping[str, Run]
    reported: tuple[Reported, ...] = ()
    line: MassLine | None = None
    hooke: Hooke | None = None

    @property
    def normalised_error(self) -> float | None:
        """E_n of Hooke's law and the oscillation, at most 1 if they agree; None if there is only one of them."""
        if self.hooke is None or not self.comparison.agree:
            return None
        return self.hooke.normalised_error(self.comparison.spring_constant)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row per run, and a row "together" for their mean."""
        return comparison_frame(self.comparison, {name: run["period"] for name, run in self.runs.items()})

    def __repr__(self) -> str:
        return "\n".join([self.comparison.message, *(of_bob.message for of_bob in self.joint)])


def _demand_one_spring(runs: Sequence[Run]) -> None:
    """Refuse runs without a mass of the bob, or of different springs: their spring constants cannot be compared."""
    missing = [run.name for run in runs if run.scene.bob_mass_kg is None]
    if missing:
        raise ProgramError(
            f"compare needs the mass of every run's bob; none is stated for {', '.join(missing)}",
            "give --scene FILE, one for all runs or one for each in their order",
        )
    first, *others = (f"{run.scene.spring_mass_kg or 'not given'} for {run.name}" for run in runs)
    for run, stated in zip(runs[1:], others, strict=True):
        if run.scene.spring_mass_kg != runs[0].scene.spring_mass_kg:
            wrong = f"compare takes runs of one spring; [spring] mass_kg is {first} and {stated}"
            raise ProgramError(wrong, "state the same in both scenes")


def compare_runs(
    runs: Sequence[Run],
    *,
    mass_correlation: float = 0.0,
    reported: str | os.PathLike[str] | None = None,
    static: str | os.PathLike[str] | None = None,
) -> SpringComparison:
    """Compare two or more runs of one spring; raise AnalysisError if one does not oscillate.

    ``mass_correlation`` is the correlation coefficient between the errors of two bobs' masses, 0 to 1. ``reported``
    is a table of printed values to judge, ``static`` one of masses and positions.
    """
    _demand_one_spring(runs)
    bobs = _of_one_bob(runs)
    springs = [SpringRun.of(run.name, run.analysis.derived, clock=run.analysis.track.clock) for run in runs]
    comparison = compare_springs(
        springs, spring_mass_kg=runs[0].scene.spring_mass_kg, mass_correlation=mass_correlation
    )
    joint = tuple(
        join([(name, m.damping, float(m.windows.t[-1]) - m.damping.t0) for name, m in group]) for group in bobs
    )
    judged, mistakes = judge(read_reported(reported, runs), runs) if reported is not None else ((), ())
    findings = by_severity([*_findings(comparison, joint), *mistakes])
    line = mass_line(springs, mass_correlation)
    hooke = read_hooke(static) if static is not None else None
    return SpringComparison(comparison, joint, findings, {run.name: run for run in runs}, judged, line, hooke)


MOST_PERIODS = 3  # runs whose period is explained


def _period_words(compared: SpringComparison) -> list[str]:
    """Return why each period is longer than the shortest: by the mass that swings, and by damping.

    With :math:`T = 2\\pi/\\omega` and :math:`\\omega_0^2 = k/M`, the ratio of two periods on one spring is that of the
    roots of M times that of :math:`\\omega_0/\\omega`, which is :math:`1 + 1/8Q^2` for linear drag.
    """
    moved = [(run.name, run["period"].value, run.analysis.derived) for run in compared.runs.values()]
    swinging = {name: (t, d.effective_mass_kg.value, d) for name, t, d in moved if d.effective_mass_kg is not None}
    if len(swinging) < len(moved) or not compared.comparison.agree:  # then the masses are not the reason
        return []
    slowed = {
        name: math.sqrt(d.estimates["spring_constant"].value / mass) * t / (2.0 * math.pi)
        for name, (t, mass, d) in swinging.items()
    }
    springs = compared.comparison
    of_run = {name: (k.value, u) for name, k, u in zip(springs.names, springs.each, springs.own_u, strict=True)}
    first, *others = sorted(swinging, key=lambda name: swinging[name][0])
    t, mass, _ = swinging[first]
    lines = []
    for name in others[-MOST_PERIODS:]:
        longer, heavier = swinging[name][0] / t - 1.0, math.sqrt(swinging[name][1] / mass) - 1.0
        damped = slowed[name] / slowed[first] - 1.0
        left, (k, u), (other_k, other_u) = longer - heavier - damped, of_run[name], of_run[first]
        apart = abs(k - other_k) / math.hypot(u, other_u)
        also = (
            f", and {100.0 * left:+.2g} % is left, {apart:.1f} u of masses and periods" if left > 0.1 * longer else ""
        )
        lines.append(
            f"The period of {name} is {100.0 * longer:.3g} % longer than that of {first}: the masses that swing, "
            f"{1e3 * swinging[name][1]:.5g} g and {1e3 * mass:.5g} g, explain {100.0 * heavier:+.3g} %, damping "
            f"{1e6 * damped:+.2g} ppm{also}."
        )
    return lines


def comparison_words(compared: SpringComparison) -> list[str]:
    """Return why the periods differ, and what the line through their squares and Hooke's law give, in sentences."""
    line, static = compared.line, compared.hooke
    lines = _period_words(compared)
    if line is not None:
        grams = Estimate(1e3 * line.effective_mass.value, 1e3 * line.effective_mass.u, "g")
        lines.append(
            f"T^2 against the mass is a line of slope 4 pi^2/k with k = {line.constant}; the effective "
            f"mass of the spring, a third of its mass, is {grams}."
        )
    if static is not None:
        count, every = int(static.straight.sum()), len(static.load)
        some = f"{count} of {every}" if static.bend else str(every)
        what = "masses" if static.load_unit == "kg" else "forces"
        bend = f" ({static.bend})" if static.bend else ""
        text, error = f"Hooke's law: k = {static.constant} from {some} {what}{bend}", compared.normalised_error
        if error is not None:
            text += f"; E_n = {error:.2g}, it {'agrees' if error <= 1.0 else 'does not agree'} with the oscillation"
        lines.append(f"{text}.")
    return lines


def comparison_json(compared: SpringComparison, provenance: Provenance) -> dict[str, Any]:
    """Return a comparison as a JSON-serialisable mapping; numbers that are not finite become None."""
    runs = compared.runs.values()
    springs = compared.comparison
    derived = [run.analysis.derived for run in runs]
    each = zip(springs.names, derived, springs.each, springs.own_u, springs.pulls, strict=True)
    results: Any = [run.result for run in runs]
    content: ComparisonResult = {
        "schema": RESULT_SCHEMA,
        "comparison": fields_of(
            Springs,
            springs,
            spring_constant=springs.spring_constant if springs.agree else None,
            spring_mass=springs.spring_mass if springs.agree else None,
            each=[
                {
                    "name": name,
                    "period": d.estimates["period"],
                    "mass": d.effective_mass_kg or Estimate(float("nan"), float("nan"), "kg"),
                    "spring_constant": k,
                    "u_own": u_own,
                    "pull": pull,
                }
                for name, d, k, u_own, pull in each
            ],
        ),
        "joint_damping": [
            fields_of(JointLaws, joint, laws={name: _law(fit) for name, fit in joint.fits.items()})
            for joint in compared.joint
        ],
        "findings": compared.findings,
        "runs": results,
        "provenance": provenance,
    }
    if compared.line is not None:
        content["mass_line"] = fields_of(LineOfMasses, compared.line)
    if compared.hooke is not None:
        content["hooke"] = {"constant": compared.hooke.constant, "normalised_error": compared.normalised_error}
    if compared.reported:
        content["reported"] = compared.reported
    every: Mapping[str, object] = content
    return {key: plain(every[key]) for key in ComparisonResult.__annotations__ if key in every}


def _of_one_bob(runs: Sequence[Run]) -> list[list[tuple[str, Oscillation]]]:
    """Group runs with the same bob, disc and unit, two or more to a group.

    The bob must be the same because the damping coefficients are inversely proportional to the mass.
    """
    groups: dict[tuple[Estimate | None, Estimate | None, str], list[tuple[str, Oscillation]]] = {}
    for run in runs:
        if (motion := run.analysis.oscillation) is None:
            raise AnalysisError(f"{run.name}: no oscillation to compare: {run.why}")
        bob = (run.scene.bob_mass_kg, run.scene.disc_diameter_m, motion.rest.mean.unit)
        groups.setdefault(bob, []).append((run.name, motion))
    return [group for group in groups.values() if len(group) > 1]


def _findings(comparison: Comparison, joint: Sequence[JointDamping]) -> list[Finding]:
    findings = []
    if comparison.exchanged:
        findings.append(Notice("runs_exchanged", {"sentence": comparison.message}))
    elif not comparison.agree:
        findings.append(Notice("springs_differ", {"sentence": comparison.message}))
    findings += [Notice("laws_differ", {"sentence": of_bob.message}) for of_bob in joint if not of_bob.one_law]
    return [word(code) for code in findings]


def _law(fit: JointFit) -> JointLaw:
    coefficients = {name: limited(fit.law, name, x) for name, x in fit.coefficients.items()}
    return fields_of(JointLaw, fit, parameters=parameters_json(coefficients))
