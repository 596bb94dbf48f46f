"""Compare the tiers with common ways to evaluate such a record: the table of docs/how-to/choose-an-accuracy.md.

``make docs-trade`` prints it and draws its figure, in a few minutes. The reference methods are as in textbooks, and
functions that scipy offers are scipy's. A tier's damping rate is that of the linear law, which the others assume.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.analyse import analyse
from pipeline.errors import AnalysisError
from pipeline.options import TIERS, options_for
from pipeline.results.classic import classic
from pipeline.track import F8, Track
from springmass.trade import SCORED_QUANTITIES, RecordDefect, TrueMotion, bounds, distances_of

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "trade.svg"
MOTION = TrueMotion(seconds=120.0)
CASES = {
    "f, A, γ at 0.3 mm": (MOTION, RecordDefect()),
    "f, A, γ at 2.39 mm": (replace(MOTION, noise_m=0.00239), RecordDefect()),
    "f, A, γ at 0.3 mm, 5 % echoes": (MOTION, RecordDefect(echoes=0.05)),
}
Values = Mapping[str, float]
Row = tuple[float, dict[str, float]]  # time in s, and errors over their bounds


def _tier(name: str) -> Callable[[Track], Values]:
    def run(track: Track) -> Values:
        found = analyse(track, options=options_for(name))
        linear = found.motion.damping.fits["linear"].joint["gamma"].value
        return {**{each: found.estimates[each].value for each in SCORED_QUANTITIES[:2]}, "damping_rate": linear}

    return run


def zero_crossings(t: F8, y: F8) -> Values:
    """Regress the interpolated times of upward crossings of the mean on their number.

    A crossing counts only from an eighth of the range below the mean to an eighth above it.
    """
    from scipy.stats import linregress

    centred = y - y.mean()
    beyond = np.flatnonzero(np.abs(centred) > 0.125 * np.ptp(np.quantile(y, (0.02, 0.98))))
    times = []
    for i, j in itertools.pairwise(beyond):
        if centred[i] < 0.0 < centred[j]:
            first = i + int(np.argmax(centred[i : j + 1] >= 0.0)) - 1
            times.append(t[first] + (t[first + 1] - t[first]) * centred[first] / (centred[first] - centred[first + 1]))
    steps = np.diff(times)
    number = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
    return {"frequency": 1.0 / linregress(number, np.array(times)).slope}


def fft_peak(t: F8, y: F8) -> Values:
    """Interpolate the largest line of the Fourier transform by Jacobsen's formula, doi:10.1109/MSP.2007.361611."""
    frequency, wave = _largest_line(t, y)
    return {"frequency": frequency, "amplitude": abs(wave)}


def _largest_line(t: F8, y: F8) -> tuple[float, complex]:
    centred = y - y.mean()
    lines = np.fft.rfft(centred)
    k = 1 + int(np.argmax(np.abs(lines[1:-1])))
    below = 2.0 * lines[k] - lines[k - 1] - lines[k + 1]
    shift = float(((lines[k - 1] - lines[k + 1]) / below).real)
    frequency = (k + min(max(shift, -0.5), 0.5)) / (y.size * float(t[-1] - t[0]) / (y.size - 1))
    return frequency, 2.0 / y.size * complex(np.sum(centred * np.exp(-2j * math.pi * frequency * t)))


def hilbert(t: F8, y: F8) -> Values:
    """Regress phase and log-amplitude of the analytic signal on time, without a twentieth at either end."""
    from scipy.signal import hilbert as analytic_signal
    from scipy.stats import linregress

    inner = slice(y.size // 20, y.size - y.size // 20)
    analytic = analytic_signal(y - y.mean())[inner]
    turns = linregress(t[inner], np.unwrap(np.angle(analytic)) / (2 * math.pi))
    decay = linregress(t[inner], np.log(np.maximum(np.abs(analytic), 1e-300)))
    return {"frequency": turns.slope, "amplitude": math.exp(decay.intercept), "damping_rate": -decay.slope}


def damped_sine(t: F8, y: F8) -> Values:
    """Fit a damped sine with scipy's curve_fit, starting from the spectrum."""
    from scipy.optimize import curve_fit

    def model(t: F8, frequency: float, amplitude: float, damping_rate: float, phase: float, offset: float) -> F8:
        return np.asarray(offset + amplitude * np.exp(-damping_rate * t) * np.cos(2 * math.pi * frequency * t + phase))

    frequency, wave = _largest_line(t, y)
    values, _ = curve_fit(model, t, y, p0=(frequency, abs(wave), 0.01, math.atan2(wave.imag, wave.real), y.mean()))
    return {"frequency": values[0], "amplitude": abs(values[1]), "damping_rate": values[2]}


METHODS: dict[str, Callable[[Track], Values]] = {
    **{f"`{tier}`": _tier(tier) for tier in TIERS},
    "classic lab method": lambda track: {
        name: each.value for name, each in classic(track).estimates.items() if name in SCORED_QUANTITIES
    },
    "zero crossings": lambda track: zero_crossings(track.t, track.y),
    "FFT peak": lambda track: fft_peak(track.t, track.y),
    "Hilbert phase": lambda track: hilbert(track.t, track.y),
    "scipy damped sine": lambda track: damped_sine(track.t, track.y),
}


def measure(motion: TrueMotion, kind: RecordDefect, seeds: int) -> dict[str, Row]:
    """Run all methods in turn on each record, so that a busy machine slows all of them alike."""
    bound, truth = bounds(motion, kind), motion.truth()
    errors: dict[str, dict[str, list[float]]] = {name: {} for name in METHODS}
    times = dict.fromkeys(METHODS, math.inf)
    for seed in range(seeds):
        track = Track.from_arrays(motion.t, distances_of(motion, kind, np.random.default_rng(seed)), kind="simulated")
        for name, method in METHODS.items():
            start = time.perf_counter()
            try:
                values = method(track)
            except (AnalysisError, RuntimeError):
                continue  # curve_fit does not converge
            times[name] = min(times[name], time.perf_counter() - start)
            for quantity, value in values.items():
                errors[name].setdefault(quantity, []).append((value - truth[quantity]) / bound[quantity])
    rms = {name: {q: float(np.sqrt(np.mean(np.square(each)))) for q, each in errors[name].items()} for name in METHODS}
    return {name: (times[name], rms[name]) for name in METHODS}


def table(seeds: int = 100, figure: Path | None = None) -> str:
    """Measure every case, draw the first, and return the table in Markdown."""
    cases = {name: measure(motion, kind, seeds) for name, (motion, kind) in CASES.items()}
    first = next(iter(cases.values()))
    if figure is not None:
        _draw(first, figure)
    fit_s = first["scipy damped sine"][0]
    lines = [f"| method | time / fit | {' | '.join(cases)} |", "| --- " * (2 + len(cases)) + "|"]
    for name, (seconds, _) in first.items():
        errors = (", ".join(_ratio(case[name][1].get(each)) for each in SCORED_QUANTITIES) for case in cases.values())
        lines.append(f"| {name} | {seconds / fit_s:.2f} | {' | '.join(errors)} |")
    return "\n".join(lines)


def _ratio(value: float | None) -> str:
    return (
        "-" if value is None else f"{value:.2f}" if value < 10 else f"{value:.3g}" if value < 1000 else f"{value:.0f}"
    )


def _draw(rows: Mapping[str, Row], path: Path) -> None:
    from matplotlib.figure import Figure

    from springmass.charts.draw import style, written

    with style():
        figure = Figure(figsize=(7.2, 7.8), layout="constrained")
        axes = figure.subplots(3, 1, sharex=True)
        for axis, quantity in zip(axes, SCORED_QUANTITIES, strict=True):
            for marker, (name, (seconds, errors)) in zip("oDsx^vP*", rows.items(), strict=True):
                axis.loglog(1e3 * seconds, errors.get(quantity, math.nan), marker, mfc="none", label=name.strip("`"))
            axis.axhline(1.0, color="grey", ls="--", label="bound")
            axis.set_ylabel(f"{quantity.replace('_', ' ')} error / bound")
        axes[-1].set_xlabel("time for one record / ms")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
        path.write_bytes(written(figure, "svg"))


if __name__ == "__main__":
    print(table(figure=FIGURE))
