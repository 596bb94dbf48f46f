"""What the samples alone say, whether they oscillate or not: how many were usable, and how they were taken."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.quantity import amount, noun, plural
from pipeline.oscillation.condition import Conditioned, Cut
from pipeline.oscillation.demodulate import Demodulated
from pipeline.results.checks.finding import Finding
from pipeline.results.checks.wave_slips import WaveSlips, judge_wave_slips
from pipeline.track import F8, U8, UNUSABLE, Quality

__all__ = ["STEPS", "Clusters", "count_quality", "find_clusters", "judge_samples"]

STEPS = 2.6  # times the noise, of which rounding by itself leaves 1 / sqrt 12: from there on it is no white noise
LEAST = 3  # false echoes that make a cluster
BRIDGED = 2  # good samples between two false echoes of one cluster, at most
TURNING = math.pi / 4.0  # phase from a turning point within which half the period's time, but a fourth of its way, lies

COUNTED = {
    str(quality.name).lower(): int(quality)
    for quality in Quality
    if quality not in (Quality.GAP_BEFORE, Quality.MALFORMED)
}


@dataclass(frozen=True, slots=True)
class Clusters:
    """False echoes that come together.

    Parameters
    ----------
    count : int
    samples : int
        False echoes in them.
    turning : int
        Clusters whose middle lies within an eighth of a period of a turning point; by chance it is half of them.
    shift_m : float
        By how much the mean amplitude would come out larger, were all false echoes left in, m.
    """

    count: int
    samples: int
    turning: int
    shift_m: float


def count_quality(flags: U8) -> dict[str, int]:
    """Return how many samples carry each flag, and how many were used.

    Examples
    --------
    >>> count_quality(np.array([0, 1, 2, 2], np.uint8))["false_echo"]
    2
    """
    counts = np.bincount(flags) if flags.any() else np.array([flags.size])
    held = [(value, count) for value, count in enumerate(counts.tolist()) if count]
    found = {name: sum(count for value, count in held if value & bit) for name, bit in COUNTED.items()}
    return {**found, "used": sum(count for value, count in held if not value & int(UNUSABLE))}


def judge_samples(
    conditioned: Conditioned,
    flags: U8,
    noise_m: float,
    clusters: Clusters | None = None,
    slips: WaveSlips | None = None,
) -> Iterator[Finding]:
    """Yield what the samples alone say, whether they oscillate or not.

    Parameters
    ----------
    conditioned : Conditioned
    flags : (n,) uint8
        Final ones.
    noise_m : float
        Standard deviation of one sample, m.
    clusters : Clusters, optional
        Of false echoes, where the record oscillates.
    slips : WaveSlips, optional
        False echoes that have a finding of their own; the clusters are of the others.
    """
    track, plateaus_m, quantum_m = conditioned.track, conditioned.plateaus_m, conditioned.quantum_m
    counts, n = count_quality(flags), len(track)
    yield from (_on_cut(cut, n, track.unit) for cut in conditioned.cuts)
    if counts["clipped"] and not any(cut.fixed for cut in conditioned.cuts):
        told = [amount(level, track.unit, ".1f") for level in plateaus_m]
        levels = " and ".join(told) or "a level flagged in the record"
        yield Finding(
            "clipped",
            "warning",
            f"{counts['clipped']} of {n} samples lie on a plateau at {levels}: a fixed object or a lost target cut the "
            "motion there; they were left out and the amplitude comes from the rest of each cycle",
        )
    if slips is not None:
        yield from judge_wave_slips(slips, n, track.unit)
    if echoes := counts["false_echo"] - (0 if slips is None else slips.rows.size):
        share = echoes / n
        yield Finding(
            "false_echoes",
            "warning" if share > 0.1 else "info",
            f"{echoes} of {n} samples ({share:.1%}) are false echoes and were left out of the fit"
            + _words_on(clusters, track.unit),
        )
    if counts["missing"]:
        yield Finding("missing_samples", "info", f"{counts['missing']} of {n} samples carry no {noun(track.unit)}")
    if counts["duplicate_time"]:
        yield Finding("duplicate_time", "warning", f"{counts['duplicate_time']} samples repeat an earlier time")
    if counts["non_monotonic_time"]:
        yield Finding("non_monotonic_time", "warning", f"{counts['non_monotonic_time']} samples run backward in time")
    if track.clock == "nominal":
        yield Finding(
            "nominal_clock",
            "info",
            "times are row numbers over the nominal rate; a crystal's 50 ppm is part of every period's uncertainty",
        )
    if track.stated_error_m is not None and track.stated_error_m > 3.0 * noise_m:
        yield Finding(
            "stated_error_is_not_noise",
            "info",
            f"the file states an error of {amount(track.stated_error_m, track.unit, '.2f')} for every "
            f"{noun(track.unit)}; "
            f"the samples scatter by {amount(noise_m, track.unit)}, so the stated error was not used as noise",
        )
    if quantum_m is not None and quantum_m > STEPS * noise_m:
        yield Finding(
            "quantised",
            "warning",
            f"{plural(track.unit)} come in steps of {amount(quantum_m, track.unit, '.3g')}, which outweigh their "
            "noise: amplitudes may err by several times their stated uncertainty",
        )


def find_clusters(
    demodulated: Demodulated, phase: Callable[[NDArray[np.int64]], F8], slips: WaveSlips | None = None
) -> Clusters:
    """Count clusters of false echoes.

    Parameters
    ----------
    demodulated : Demodulated
        For its flags, and for how far off flagged samples lie.
    phase : callable
        Gives the phase of the oscillation at some rows (k,) int64 of the record, (k,) float64, rad.
    slips : WaveSlips, optional
        False echoes that are left out here.

    Notes
    -----
    The shift is what least squares would make of the false echoes' residuals r, in first order:
    :math:`2\\sum r_i\\cos\\varphi_i/N`, the sum over false echoes and N all samples fitted.
    """
    echo = (demodulated.flags & np.uint8(Quality.FALSE_ECHO)) != 0
    if slips is not None:
        echo[slips.rows] = False
    rows = np.flatnonzero(echo)
    if not rows.size:
        return Clusters(0, 0, 0, 0.0)
    angle = phase(rows)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(rows) > BRIDGED + 1) + 1])
    sizes = np.diff(np.concatenate([starts, [rows.size]]))
    clusters = sizes >= LEAST
    middles = angle[(starts + sizes // 2)[clusters]]
    turning = np.abs(middles - math.pi * np.round(middles / math.pi)) <= TURNING
    fitted = np.count_nonzero((demodulated.flags & UNUSABLE) == 0) + rows.size
    residual = demodulated.residual[rows]
    residual[~np.isfinite(residual)] = 0.0
    shift = 2.0 * float(residual @ np.cos(angle)) / fitted
    return Clusters(int(np.count_nonzero(clusters)), int(sizes[clusters].sum()), int(np.count_nonzero(turning)), shift)


def _on_cut(cut: Cut, n: int, unit: str) -> Finding:
    """What is said of an end at which the motion is cut."""
    end = cut.end if unit == "m" else {"far": "upper", "near": "lower"}[cut.end]
    where = (
        f"{cut.samples} of {n} samples ({cut.samples / n:.0%}), between {cut.first_s:.2f} and {cut.last_s:.2f} s "
        f"at the {end} end from {amount(cut.from_m, unit, '.1f')} on,"
    )
    out = "they were left out by where the fitted motion goes, and the amplitude comes from the rest of each cycle"
    if cut.fixed:
        why = "behind the motion that the rest of each cycle shows: a fixed object or a lost target cuts it there"
        level = f"lie on a plateau at {amount(cut.level_m, unit, '.1f')},"
        return Finding("clipped", "warning", f"{where} {level} {why}; {out}")
    why = "move with the bob, but not as it does in the rest of each cycle: an echo by way of something beside it"
    return Finding("locked_echoes", "warning", f"{where} {why}; {out}")


def _words_on(clusters: Clusters | None, unit: str) -> str:
    if clusters is None or not clusters.count:
        return ""
    many = f"{clusters.count} cluster{'s' * (clusters.count > 1)}"
    return (
        f"; {clusters.samples} of them come in {many}, {clusters.turning} of these at turning "
        f"points; left in, all of them would change the amplitude by {amount(clusters.shift_m, unit, '+.2g')}"
    )
