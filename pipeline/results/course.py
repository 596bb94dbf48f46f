"""Many runs of a course: whether they agree on spring, disc and drag, and which runs have wrong notes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.robust import mad_sigma
from pipeline.track import F8

Cause = Literal[
    "masses exchanged", "unit of the mass", "unit of the distance", "clipped", "wrong disc", "wrong spring", "unknown"
]
"""The possible causes of a run that differs from its course."""
FAR = 5.0  # distance from the median, in standard deviations, above which a run is suspect: none of 200 good runs
NEAR = 4.0  # maximum distance from the median, in standard deviations, after a cause is corrected
FEW = 4  # minimum number of runs in a group for a median
POWERS = (-3, -2, -1, 1, 2, 3)  # powers of ten between units
LEAST_SCATTER = {"spring": 2e-4, "drag": 0.02}  # minimum relative scatter of a group, if its runs agree by chance
SPREAD_OF_KC = 0.5  # minimum spread of ln KC for which a slope against it is fitted


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseRun:
    """The results and the notes of one run.

    Parameters
    ----------
    name, spring, disc, bench : str
        Labels; runs with the same spring, disc or bench have the same label.
    spring_constant : Estimate or None
        Spring constant, N/m; its uncertainty includes only errors that the run does not share with others.
    bob_mass_kg : float
        Mass of the bob as noted, kg; NaN if it is not noted.
    natural_angular_frequency : float
        Angular frequency of the undamped motion, rad/s; NaN if the run has none.
    amplitude_m, offset_m, noise_m : float
        Amplitude, rest position and noise as recorded, m.
    diameter_m : float
        Diameter of the disc as noted, m; NaN without a disc.
    drag : Estimate or None
        Drag coefficient in the middle of the amplitudes of the run.
    keulegan_carpenter : float
        Keulegan-Carpenter number at the same amplitude.
    clipped : bool
        Whether the record has the finding "clipped".
    """

    name: str
    spring: str = ""
    disc: str = ""
    bench: str = ""
    spring_constant: Estimate | None = None
    bob_mass_kg: float = math.nan
    natural_angular_frequency: float = math.nan
    amplitude_m: float = math.nan
    offset_m: float = math.nan
    noise_m: float = math.nan
    diameter_m: float = math.nan
    drag: Estimate | None = None
    keulegan_carpenter: float = math.nan
    clipped: bool = False

    def constant_with(self, bob_mass_kg: float) -> float:
        """Return the spring constant for another mass of the bob, N/m; the shares of spring and air stay the same."""
        assert self.spring_constant is not None
        squared = self.natural_angular_frequency**2
        return self.spring_constant.value + squared * (bob_mass_kg - self.bob_mass_kg)


@dataclass(frozen=True, slots=True)
class Suspect:
    """A run that differs from its course.

    Parameters
    ----------
    name : str
    cause : str
        The most likely cause, one of :data:`Cause`.
    message : str
    other : str
        Name of the run, spring or disc with which it was confused; empty if there is none.
    """

    name: str
    cause: Cause
    message: str
    other: str = ""


@dataclass(frozen=True, slots=True)
class Agreement:
    """The agreement of many runs on one quantity.

    Parameters
    ----------
    quantity, group : str
        Names of the quantity and of the group of runs.
    mean : Estimate
        Mean over benches; its uncertainty includes the scatter between them.
    within, between : float
        Standard deviation of runs at one bench, and additional standard deviation between benches. ``within`` is NaN if
        no bench has two runs, and ``between`` is NaN if there is only one bench.
    stated : float
        Root mean square of the standard uncertainties of the runs.
    runs, benches : int
        Numbers of runs and benches.
    chi2, dof : float
        Chi-square and degrees of freedom of the means of the benches, with the scatter within benches.
    """

    quantity: str
    group: str
    mean: Estimate
    within: float
    between: float
    stated: float
    runs: int
    benches: int
    chi2: float = math.nan
    dof: int = 0


def agreement(quantity: str, group: str, values: Sequence[Estimate], benches: Sequence[str]) -> Agreement:
    """Return how far runs of several benches agree on one quantity.

    Parameters
    ----------
    quantity, group : str
        Names of the quantity and of the group of runs.
    values : sequence of Estimate
        One value for each run, at least one; u includes only errors that the run does not share.
    benches : sequence of str
        Bench of each run.

    Raises
    ------
    AnalysisError
        If there is no run.

    Notes
    -----
    The model is the one-way layout with random effects :math:`x_{ij} = \\mu + b_j + e_{ij}`, fitted by its moments
    [1]_. The variance within benches is the pooled variance of runs about the mean of their bench. The variance between
    benches is the variance of the means less the part from scatter within benches, by the moments of DerSimonian and
    Laird. The uncertainty of a bench's mean uses the larger of the scatter within benches and the stated uncertainty of
    the runs.

    References
    ----------
    .. [1] R. DerSimonian, N. Laird, Controlled Clinical Trials 7 (1986) 177.

    Examples
    --------
    >>> runs = [Estimate(x, 0.01, "N/m") for x in (14.00, 14.02, 14.10, 14.12)]
    >>> found = agreement("spring_constant", "A", runs, ["1", "1", "2", "2"])
    >>> print(found.mean, f"{found.within:.3f} {found.between:.3f}")
    14.060 +- 0.050 N/m 0.014 0.070
    """
    if not values:
        raise AnalysisError(f"{quantity} of {group}: expected a run that gives it, got none")
    x = np.array([value.value for value in values])
    stated = math.sqrt(float(np.mean([value.u**2 for value in values])))
    names = list(dict.fromkeys(benches))
    parts = [x[[bench == name for bench in benches]] for name in names]
    free = x.size - len(parts)
    within = math.sqrt(sum(float(np.sum((part - part.mean()) ** 2)) for part in parts) / free) if free else math.nan
    scatter = stated if math.isnan(within) else max(within, stated)
    means = np.array([part.mean() for part in parts])
    variances = np.array([scatter**2 / part.size for part in parts])
    between, chi2, dof = math.nan, math.nan, len(parts) - 1
    weights = 1.0 / np.maximum(variances, 1e-300)
    if dof:
        middle = float(weights @ means / weights.sum())
        chi2 = float(weights @ (means - middle) ** 2)
        excess = (chi2 - dof) / float(weights.sum() - (weights @ weights) / weights.sum())
        between = math.sqrt(max(excess, 0.0))
        weights = 1.0 / np.maximum(variances + between**2, 1e-300)
    mean = Estimate(float(weights @ means / weights.sum()), float(weights.sum() ** -0.5), values[0].unit)
    return Agreement(quantity, group, mean, within, between, stated, x.size, len(parts), chi2, dof)


def suspects(runs: Sequence[CourseRun]) -> tuple[Suspect, ...]:
    """Return the runs that differ from their course, each with its most likely cause, in the order of the runs.

    Parameters
    ----------
    runs : sequence of CourseRun

    Notes
    -----
    Each run is compared with the median of its group, and with the scatter from the median absolute deviation. The
    causes are:

    - clipped: the record has this finding;
    - unit of the distance: noise, rest position and amplitude all differ from the course by the same power of ten.

    If a spring constant is farther than :data:`FAR` from those of the same spring, the cause is the first of these:

    - masses exchanged: two such runs agree with their springs after their masses are exchanged;
    - unit of the mass: the run agrees if its mass is multiplied by a power of ten;
    - wrong spring: the constant agrees with that of another spring;
    - unknown.

    If a drag coefficient is far from those of the same disc at the same Keulegan-Carpenter number, the cause is a wrong
    disc or unknown. It is a wrong disc if the coefficient agrees with that of another disc after a correction for its
    diameter, :math:`C \\propto D^{-2}`.
    """
    found: dict[str, Suspect] = {}
    for one in (*_clipped(runs), *_in_other_units(runs), *_springs(runs)):
        found.setdefault(one.name, one)
    # A drag coefficient depends on length, mass and amplitude, so a run with one of these wrong does not test its disc.
    # But a wrong disc also changes k, by the air carried along, so runs with an unknown cause are tested.
    for one in _discs([run for run in runs if run.name not in found or found[run.name].cause == "unknown"]):
        found[one.name] = one
    return tuple(found[run.name] for run in runs if run.name in found)


def _clipped(runs: Sequence[CourseRun]) -> Iterator[Suspect]:
    for run in runs:
        if run.clipped:
            yield Suspect(run.name, "clipped", "its record is cut off at an end: the amplitude went beyond the range")


def _in_other_units(runs: Sequence[CourseRun]) -> Iterator[Suspect]:
    """Yield runs in which noise, rest position and amplitude all differ from the course by one power of ten."""
    logs = np.log10(
        [[max(abs(x), 1e-300) for x in (r.noise_m, r.offset_m, r.amplitude_m)] for r in runs] or [[0.0] * 3]
    )
    if np.isfinite(logs).all(axis=1).sum() < FEW:
        return
    middle = np.nanmedian(logs, axis=0)
    for run, log in zip(runs, logs, strict=True):
        away = log - middle
        for power in POWERS:
            # The noise depends on the sensor and the rest position on the bench; amplitudes vary most between users.
            if np.all(np.abs(away - power) < (0.3, 0.35, 0.5)):
                message = (
                    f"noise, rest position and amplitude are 10^{power:+d} of the course's: the unit of its distances"
                )
                yield Suspect(run.name, "unit of the distance", message)


@dataclass(frozen=True, slots=True)
class _Middle:
    """The location of the logarithms of a group: a median, or a line against ln KC, and the scatter about it."""

    centre: float
    scatter: float
    slope: float = 0.0
    label: str = field(default="", compare=False)

    def away(self, y: float, u: float, x: float = 0.0) -> float:
        return (y - self.centre - self.slope * x) / math.hypot(self.scatter, u)


def _middle(y: F8, least: float, x: F8 | None = None, label: str = "") -> _Middle:
    slope = 0.0
    if x is not None and np.ptp(np.quantile(x, (0.1, 0.9))) > SPREAD_OF_KC:
        first, second = np.triu_indices(x.size, 1)
        apart = np.abs(x[second] - x[first]) > 0.2 * SPREAD_OF_KC
        slope = float(np.median(((y[second] - y[first])[apart]) / (x[second] - x[first])[apart]))
    rest = y if x is None else y - slope * x
    centre = float(np.median(rest))
    return _Middle(centre, max(mad_sigma(rest - centre), least), slope, label)


def _springs(runs: Sequence[CourseRun]) -> Iterator[Suspect]:
    known = [run for run in runs if run.spring_constant is not None and run.spring_constant.value > 0]
    middles = {
        spring: _middle(np.array([_log(run.spring_constant) for run in group]), LEAST_SCATTER["spring"], label=spring)
        for spring, group in _groups(known, "spring").items()
        if len(group) >= FEW
    }
    known = [run for run in known if run.spring in middles]
    far = [run for run in known if abs(_away(run, middles)) > FAR]
    partners = _exchanged(far, middles)
    for run in far:
        middle = middles[run.spring]
        off = _log(run.spring_constant) - middle.centre
        text = f"k is {100 * math.expm1(off):+.3g} % off the {middle.label or 'course'}'s"
        powers = [p for p in POWERS if abs(_away(run, middles, mass=run.bob_mass_kg * 10.0**p)) < NEAR]
        if run.name in partners:
            other = partners[run.name]
            message = f"{text}; with its mass and that of {other} exchanged both agree with their springs"
            yield Suspect(run.name, "masses exchanged", message, other)
        elif powers:
            message = f"{text}; with 10^{powers[0]:+d} of its mass it agrees: the unit of its mass"
            yield Suspect(run.name, "unit of the mass", message)
        elif near := [m.label for s, m in middles.items() if s != run.spring and abs(_away(run, middles, m)) < NEAR]:
            yield Suspect(run.name, "wrong spring", f"{text}, and that of spring {near[0]}", near[0])
        else:
            yield Suspect(run.name, "unknown", f"{text}: look at its mass and its spring")


def _away(
    run: CourseRun, middles: Mapping[str, _Middle], middle: _Middle | None = None, mass: float | None = None
) -> float:
    """Return the distance of a run's spring constant from a median, in standard deviations.

    A mass replaces the noted one if it is given.
    """
    k = run.spring_constant
    assert k is not None
    value = k.value if mass is None else run.constant_with(mass)
    if not value > 0:
        return math.inf
    return (middle or middles[run.spring]).away(math.log(value), k.u / k.value)


def _exchanged(far: Sequence[CourseRun], middles: Mapping[str, _Middle]) -> dict[str, str]:
    """Return the partner of each run, for pairs that agree with their springs after their masses are exchanged.

    Pairs from the same bench take precedence, then pairs that agree better.
    """
    pairs = []
    for i, one in enumerate(far):
        for other in far[i + 1 :]:
            away = max(
                abs(_away(one, middles, mass=other.bob_mass_kg)), abs(_away(other, middles, mass=one.bob_mass_kg))
            )
            if away < NEAR:
                pairs.append((one.bench != other.bench, away, one.name, other.name))
    partners: dict[str, str] = {}
    for _, _, one_name, other_name in sorted(pairs):
        if one_name not in partners and other_name not in partners:
            partners |= {one_name: other_name, other_name: one_name}
    return partners


def _discs(runs: Sequence[CourseRun]) -> Iterator[Suspect]:
    known = [
        r for r in runs if r.drag is not None and r.drag.value > 0 and r.keulegan_carpenter > 0 and r.diameter_m > 0
    ]
    groups = {disc: group for disc, group in _groups(known, "disc").items() if len(group) >= FEW}
    middles, diameters = {}, {}
    for disc, group in groups.items():
        logs = np.array([(_log(r.drag), math.log(r.keulegan_carpenter)) for r in group])
        middles[disc] = _middle(logs[:, 0], LEAST_SCATTER["drag"], logs[:, 1], disc)
        diameters[disc] = float(np.median([r.diameter_m for r in group]))
    for disc, group in groups.items():
        for run in group:
            y, x, u = _log(run.drag), math.log(run.keulegan_carpenter), run.drag.u / run.drag.value  # type: ignore[union-attr]
            if abs(away := middles[disc].away(y, u, x)) <= FAR:
                continue
            text = f"its drag coefficient is {away:+.0f} standard deviations off that of its disc"
            step = {d: math.log(run.diameter_m / diameters[d]) for d in groups if d != disc}
            sizes = [(abs(middles[d].away(y + 2 * s, u, x + s)), d) for d, s in step.items()]
            if sizes and min(sizes)[0] < NEAR:
                near = min(sizes)[1]
                message = f"{text}; with the diameter of {near}, {diameters[near]:.4g} m, it is that of {near}"
                yield Suspect(run.name, "wrong disc", message, near)
            else:
                yield Suspect(run.name, "unknown", f"{text}: look at its disc and its mass")


def _groups(runs: Sequence[CourseRun], by: Literal["spring", "disc"]) -> dict[str, list[CourseRun]]:
    groups: dict[str, list[CourseRun]] = {}
    for run in runs:
        groups.setdefault(getattr(run, by), []).append(run)
    return groups


def _log(x: Estimate | None) -> float:
    assert x is not None
    return math.log(x.value)
