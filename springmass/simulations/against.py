"""Compare a measured run with the prediction of its scene: residuals, the band, and inputs that would explain them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.estimate import Estimate
from pipeline.simulation import Problem, Trajectory
from pipeline.simulation.band import Band
from pipeline.track import C16, F8
from springmass.simulations.from_run import oscillation_of

WIDER = 1.96  # standard deviations of the noise by which the band is widened, for 95 %
HALF = 0.5
FURTHEST_U = 20.0  # maximum change of an input, in standard uncertainties
LARGEST_RESIDUAL_M = 1e300  # m; residual assigned to a change that gives no finite residual


@dataclass(frozen=True, slots=True)
class InputShift:
    """The change of one input alone that brings the prediction closest to the run, and the rms that is then left."""

    name: str
    given: float
    value: float
    in_u: float
    rms_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Against:
    """A measured run with a prediction laid over it, at the samples used (n,), in s and m.

    ``free`` has the times since the first sample, the displacements and the fitted velocities without false echoes.
    ``estimates`` are the results of the run, with the ``last_amplitude``, at the end of ``trajectory``.
    ``band`` has the quantiles (4, n) of the predicted distance relative to ``predicted``; ``inside`` is the share of
    the samples within its 95 % widened by the noise, and ``leaves_band_s`` the time from which the run leaves it.
    """

    trajectory: Trajectory
    t: F8
    measured: F8
    predicted: F8
    rms_m: float
    noise_m: float
    free: tuple[F8, F8, F8]
    estimates: Mapping[str, Estimate]
    band: F8 | None = None
    inside: float | None = None
    leaves_band_s: float | None = None
    shifts: tuple[InputShift, ...] = ()


def compare_with_run(
    analysis: Analysis, trajectory: Trajectory, band: Band | None, values: Mapping[str, Estimate]
) -> Against:
    """Lay a prediction over a measured run from its first used sample on.

    With a band, those ``values`` of its inputs are sought that fit best.
    """
    motion, used = oscillation_of(analysis), analysis.samples.used
    t, measured = analysis.track.t[used], analysis.track.y[used]
    rest, good = motion.rest.at(t), analysis.used[used]
    free = (t - t[0])[good], (measured - rest)[good], motion.waveform.velocity[used][good]
    predicted: F8 = rest + trajectory.at(t - t[0])
    rms = float(np.sqrt(np.mean((measured - predicted) ** 2)))
    noise = analysis.estimates["noise"].value
    last = _amplitude_at(analysis, motion, t[0] + trajectory.t[-1])
    known = trajectory, t, measured, predicted, rms, noise, free, {**analysis.estimates, "last_amplitude": last}
    if band is None:
        return Against(*known)
    around = band.displacement_at(t - t[0])
    left = measured - predicted
    outside = (left < around[0] - WIDER * noise) | (left > around[3] + WIDER * noise)
    shifts = _shifts(band, t - t[0], left, values)
    inside = 1.0 - float(np.mean(outside))
    leaves_band_s = _leaves(t, outside, trajectory.problem)
    return Against(*known, around, inside, leaves_band_s, shifts)


def against_json(against: Against) -> dict[str, Any]:
    """Return the comparison as the JSON of ``springmass simulate`` has it."""
    return {
        "rms_m": against.rms_m,
        "noise_m": against.noise_m,
        "inside_95": against.inside,
        "leaves_s": against.leaves_band_s,
        "moves": [
            {"name": shift.name, "from": shift.given, "to": shift.value, "in_u": shift.in_u, "rms_m": shift.rms_m}
            for shift in against.shifts
        ],
    }


def _amplitude_at(analysis: Analysis, motion: Oscillation, t: float) -> Estimate:
    """Return the amplitude by the damping law at a time; what u of the start has besides that law scales it too."""
    start, at = analysis.estimates["amplitude"], np.array([0.0, t - motion.damping.t0])
    (first, last), own = motion.damping.best.amplitude(at), motion.damping.best.u_amplitude(at)
    shared = math.sqrt(max((start.u / start.value) ** 2 - (own[0] / first) ** 2, 0.0))
    size = start.value * float(last / first)
    return Estimate(size, math.hypot(size * shared, start.value * float(own[1] / first)), start.unit)


def _leaves(t: F8, outside: NDArray[np.bool_], problem: Problem) -> float | None:
    """Return the time from which more than half the samples of a period lie outside the band; None if they never do."""
    period_s = 2.0 * math.pi / problem.equation.angular_frequency_per_s
    # Number of samples outside the band in the period that starts at each sample; the record may have gaps.
    total = np.concatenate([[0], np.cumsum(outside)])
    ends = np.searchsorted(t, t + period_s, side="right")
    share = (total[ends] - total[:-1]) / (ends - np.arange(t.size))
    whole = t + period_s <= t[-1]
    beginnings = np.flatnonzero(whole & (share > HALF))
    return float(t[beginnings[0]]) if beginnings.size else None


def _shifts(band: Band, since: F8, left: F8, values: Mapping[str, Estimate]) -> tuple[InputShift, ...]:
    """Return the least-squares change of each input alone that brings the prediction closest to the record."""
    from scipy.optimize import minimize_scalar

    shifts = []
    # Evaluated at the times of the band, whose states are two fifths of a radian apart.
    rows = np.unique(np.searchsorted(band.t, since).clip(max=band.t.size - 1))
    at = np.interp(band.t[rows], since, left)
    middle = band.middle[rows]
    for name, log in zip(band.quantities, band.of_log, strict=True):
        if name not in values or values[name].u <= 0.0:
            continue

        def rms(shift: float, of: C16 = log[rows]) -> float:
            with np.errstate(over="ignore", invalid="ignore"):
                moved = (middle * np.expm1(shift * of)).real
                size = float(np.sqrt(np.mean((at - moved) ** 2)))
            return size if math.isfinite(size) else LARGEST_RESIDUAL_M

        grid = np.linspace(-FURTHEST_U, FURTHEST_U, 401)
        best = float(grid[int(np.argmin([rms(each) for each in grid]))])
        step = float(grid[1] - grid[0])
        shift = float(minimize_scalar(rms, bounds=(best - step, best + step), method="bounded").x)
        given = values[name]
        shifts.append(InputShift(name, given.value, given.value + shift * given.u, shift, rms(shift)))
    return tuple(sorted(shifts, key=lambda shift: shift.rms_m))


def deviation_text(against: Against) -> list[str]:
    """Return lines that state where the record leaves the band, and which changes of an input would explain it."""
    if against.inside is None:
        return []
    lines = [f"in the band      {against.inside:.1%} of the samples lie within 95 % and the noise"]
    if against.leaves_band_s is None:
        lines.append("                 the record never leaves it for half a period")
        return lines
    lines.append(
        f"leaves the band  from {against.leaves_band_s:.3g} s on more than half of a period's samples are outside"
    )
    for shift in against.shifts[:3]:
        far = abs(shift.in_u) > 0.99 * FURTHEST_U
        lines.append(
            f"                 {shift.name} alone would have to be {shift.value:.6g}, not {shift.given:.6g} "
            f"({'more than ' if far else ''}{shift.in_u:+.1f} u): rms {shift.rms_m * 1e3:.3g} mm would be left"
        )
    return lines


def duration_s(analysis: Analysis) -> float:
    """Return the time from the first to the last used sample, s."""
    t = analysis.track.t[analysis.samples.used]
    return float(t[-1] - t[0])
