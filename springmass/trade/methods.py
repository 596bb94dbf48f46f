"""Reference methods: common ways to evaluate such a record, each as in textbooks.

They serve only for comparison; no analysis uses them. They need evenly sampled distances, so gaps of a track are first
bridged by straight lines; tiers get the unchanged track. Functions that scipy offers are taken from scipy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.analyse import Oscillation, analyse
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.options import TIERS, options_for
from pipeline.results.classic import classic
from pipeline.track import F8, Track

__all__ = ["UNITS", "Method", "references", "tiers"]

UNITS = {"frequency": "Hz", "amplitude": "m", "damping_rate": "1/s"}
Estimates = Mapping[str, Estimate]


@dataclass(frozen=True, slots=True)
class Method:
    """One way to evaluate a record.

    Parameters
    ----------
    name, label : str
        The name in JSON and the printed label.
    kind : {"tier", "reference"}
    run : callable
        Takes a track and returns estimates by name; u is NaN if the method states no uncertainty. Raises AnalysisError
        if it finds no oscillation.
    """

    name: str
    label: str
    kind: Literal["tier", "reference"]
    run: Callable[[Track], Estimates]


def tiers(*, linear: bool = False) -> list[Method]:
    """Return the accuracies of ``springmass analyse``, from the track to the printed estimates.

    Parameters
    ----------
    linear : bool
        Whether to take the damping rate of the linear law, for comparison with methods that assume this law. The
        printed rate includes the choice of a law.
    """
    return [Method(tier, f"springmass {tier}", "tier", _tier(tier, linear)) for tier in TIERS]


def references() -> list[Method]:
    """Return the common methods for such records."""
    return [
        Method("classic", "classic lab method", "reference", lambda track: _compared(classic(track).estimates)),
        Method("zero_crossings", "zero crossings", "reference", _bridged(zero_crossings)),
        Method("fft_peak", "FFT peak", "reference", _bridged(fft_peak)),
        Method("hilbert", "Hilbert phase", "reference", _bridged(hilbert)),
        Method("scipy", "scipy damped sine", "reference", _bridged(damped_sine)),
    ]


def _bridged(estimate: Callable[[F8, F8], Estimates]) -> Callable[[Track], Estimates]:
    """Turn a function of times and distances into a function of a track; straight lines bridge the gaps."""

    def run(track: Track) -> Estimates:
        known = np.isfinite(track.y) & np.isfinite(track.t)
        return estimate(track.t, np.interp(track.t, track.t[known], track.y[known]))

    return run


def _tier(name: str, linear: bool) -> Callable[[Track], Estimates]:
    def run(track: Track) -> Estimates:
        analysis = analyse(track, options=options_for(name))
        if not isinstance(analysis.motion, Oscillation):
            raise AnalysisError(analysis.motion.why)
        estimates = dict(_compared(analysis.estimates))
        if linear and (fit := analysis.motion.damping.fits.get("linear")) is not None:
            estimates["damping_rate"] = fit.joint["gamma"]
        return estimates

    return run


def _compared(estimates: Estimates) -> Estimates:
    return {name: estimates[name] for name in UNITS if name in estimates}


def zero_crossings(t: F8, y: F8) -> Estimates:
    """Regress the interpolated times of upward crossings of the mean on the number of the crossing.

    Notes
    -----
    A crossing counts only if the signal goes from an eighth of its range below the mean to an eighth above it. After
    smaller swings, the elapsed time determines the number of the next crossing.
    """
    from scipy.stats import linregress

    centred = y - y.mean()
    reach = 0.125 * np.ptp(np.quantile(y, (0.02, 0.98)))
    beyond = np.flatnonzero(np.abs(centred) > reach)
    times = []
    for i, j in itertools.pairwise(beyond):
        if centred[i] < 0.0 < centred[j]:
            first = i + int(np.argmax(centred[i : j + 1] >= 0.0)) - 1
            times.append(t[first] + (t[first + 1] - t[first]) * centred[first] / (centred[first] - centred[first + 1]))
    if len(times) < 3:
        raise AnalysisError(f"zero crossings need three upward crossings, got {len(times)}")
    steps = np.diff(times)
    number = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
    line = linregress(number, np.array(times))
    return {"frequency": Estimate(1.0 / line.slope, line.stderr / line.slope**2, "Hz")}


def fft_peak(t: F8, y: F8) -> Estimates:
    """Interpolate the largest line of the discrete Fourier transform by Jacobsen's formula.

    References
    ----------
    E. Jacobsen, P. Kootsookos, "Fast, accurate frequency estimators", IEEE Signal Process. Mag. 24 (2007) 123,
    doi:10.1109/MSP.2007.361611.
    """
    frequency, wave = _largest_line(t, y)
    return {"frequency": Estimate(frequency, math.nan, "Hz"), "amplitude": Estimate(abs(wave), math.nan, "m")}


def _largest_line(t: F8, y: F8) -> tuple[float, complex]:
    """Return frequency and complex amplitude at t = 0 of the largest line."""
    centred = y - y.mean()
    lines = np.fft.rfft(centred)
    k = 1 + int(np.argmax(np.abs(lines[1:-1])))
    below = 2.0 * lines[k] - lines[k - 1] - lines[k + 1]
    shift = float(((lines[k - 1] - lines[k + 1]) / below).real) if below != 0 else 0.0
    step = float(t[-1] - t[0]) / (y.size - 1)
    frequency = (k + min(max(shift, -0.5), 0.5)) / (y.size * step)
    return frequency, 2.0 / y.size * complex(np.sum(centred * np.exp(-2j * math.pi * frequency * t)))


def hilbert(t: F8, y: F8) -> Estimates:
    """Regress phase and log-amplitude of the analytic signal on time, without a twentieth at either end."""
    from scipy.signal import hilbert as analytic_signal
    from scipy.stats import linregress

    inner = slice(y.size // 20, y.size - y.size // 20)
    analytic = analytic_signal(y - y.mean())[inner]
    turns = linregress(t[inner], np.unwrap(np.angle(analytic)) / (2 * math.pi))
    decay = linregress(t[inner], np.log(np.maximum(np.abs(analytic), 1e-300)))
    return {
        "frequency": Estimate(float(turns.slope), float(turns.stderr), "Hz"),
        "amplitude": Estimate(math.exp(decay.intercept + decay.slope * float(t[0])), math.nan, "m"),
        "damping_rate": Estimate(-float(decay.slope), float(decay.stderr), "1/s"),
    }


def damped_sine(t: F8, y: F8) -> Estimates:
    """Fit amplitude, frequency, damping rate, phase and offset with scipy's curve_fit, starting from the spectrum."""
    from scipy.optimize import curve_fit

    def model(t: F8, frequency: float, amplitude: float, damping_rate: float, phase: float, offset: float) -> F8:
        return np.asarray(offset + amplitude * np.exp(-damping_rate * t) * np.cos(2 * math.pi * frequency * t + phase))

    frequency, wave = _largest_line(t, y)
    start = (frequency, abs(wave), 0.01, math.atan2(wave.imag, wave.real), float(y.mean()))
    try:
        values, covariance = curve_fit(model, t, y, p0=start)
    except RuntimeError as error:
        raise AnalysisError(f"curve_fit: {error}") from error
    values[1] = abs(values[1])  # a negative amplitude is the same motion with the phase shifted by half a turn
    u = np.sqrt(np.diag(covariance))
    return {name: Estimate(float(values[i]), float(u[i]), unit) for i, (name, unit) in enumerate(UNITS.items())}
