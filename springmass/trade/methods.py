"""Reference methods: how such a record is evaluated elsewhere, each as its textbook has it.

They stand here to be compared with; none is used by an analysis. They demand evenly sampled distances, so gaps of a
track are bridged by straight lines before; tiers get the track as it is. What scipy has is scipy's. Kept by hand are
the zero crossings, Jacobsen's interpolation of a line and the matrix pencil, which it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Literal

import numpy as np

from pipeline.accuracy import TIERS, params_for
from pipeline.analyse import Oscillation, analyse
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.results.classic import classic
from pipeline.track import F8, Track

__all__ = ["UNITS", "Method", "Unavailable", "methods", "presets"]

UNITS = {"frequency": "Hz", "amplitude": "m", "damping_rate": "1/s"}
Found = Mapping[str, Estimate]


@dataclass(frozen=True, slots=True)
class Method:
    """One way to evaluate a record.

    Parameters
    ----------
    name, label : str
        As in JSON and as printed.
    kind : {"tier", "reference"}
    run : callable
        Of a track to estimates by name; u is NaN where the method states none. Raises AnalysisError where it finds no
        oscillation.
    """

    name: str
    label: str
    kind: Literal["tier", "reference"]
    run: Callable[[Track], Found]

    @property
    def short(self) -> str:
        """The label for a drawing, where colour tells the tiers."""
        return self.name if self.kind == "tier" else self.label


@dataclass(frozen=True, slots=True)
class Unavailable:
    """A method that this installation lacks a package for."""

    name: str
    needs: str


def methods() -> tuple[list[Method], list[Unavailable]]:
    """Return what can be run here, tiers first, and what cannot."""
    found = [Method(tier, f"springmass {tier}", "tier", _tier(tier)) for tier in TIERS]
    found += [
        Method("classic", "classic lab method", "reference", _classic),
        Method("zero_crossings", "zero crossings", "reference", _bridged(zero_crossings)),
        Method("fft_peak", "FFT peak", "reference", _bridged(fft_peak)),
        Method("hilbert", "Hilbert phase", "reference", _bridged(hilbert)),
        Method("matrix_pencil", "matrix pencil", "reference", _bridged(matrix_pencil)),
    ]
    if find_spec("lmfit") is None:
        found.append(Method("scipy", "scipy damped sine", "reference", _bridged(_scipy)))
        return found, [Unavailable("lmfit", "lmfit")]
    return [*found, Method("lmfit", "lmfit damped sine", "reference", _bridged(_lmfit))], []


def presets() -> list[Method]:
    """Return the tiers with the damping rate that they print, of whichever law they chose."""
    return [Method(tier, f"springmass {tier}", "tier", _tier(tier, printed=True)) for tier in TIERS]


def _bridged(estimate: Callable[[F8, F8], Found]) -> Callable[[Track], Found]:
    """Let a function of times and distances take a track."""

    def run(track: Track) -> Found:
        there = np.isfinite(track.y) & np.isfinite(track.t)
        y = track.y if there.all() else np.interp(track.t, track.t[there], track.y[there])
        return estimate(track.t, y)

    return run


def _tier(name: str, *, printed: bool = False) -> Callable[[Track], Found]:
    """Return a tier of the analysis, everything from the track to the findings included."""
    params = params_for(name)

    def run(track: Track) -> Found:
        analysis = analyse(track, params=params)
        if not isinstance(analysis.motion, Oscillation):
            raise AnalysisError(analysis.motion.why)
        if printed:
            return {key: analysis.estimates[key] for key in UNITS if key in analysis.estimates}
        found = {key: analysis.estimates[key] for key in ("frequency", "amplitude")}
        # Comparable with methods that take the exponential for granted; the printed rate holds the choice of a law.
        linear = analysis.motion.damping.fits.get("linear")
        return found if linear is None else {**found, "damping_rate": linear.joint["gamma"]}

    return run


def _classic(track: Track) -> Found:
    found = classic(track).estimates
    return {name: found[name] for name in UNITS}


def zero_crossings(t: F8, y: F8) -> Found:
    """Regress the times of upward crossings of the middle, interpolated between two samples, on their number.

    Notes
    -----
    A crossing counts after the signal was an eighth of its range below the mean. Where a swing stays under that, the
    count goes on by the time that passed. The slope's uncertainty is the regression's own.
    """
    from scipy.stats import linregress

    low, high = np.quantile(y, (0.02, 0.98))
    centred, reach = y - y.mean(), 0.125 * (high - low)
    state = np.where(centred > reach, 1, np.where(centred < -reach, -1, 0))
    known = np.flatnonzero(state)
    turns = np.flatnonzero((state[known[:-1]] < 0) & (state[known[1:]] > 0))
    times = []
    for turn in turns:
        rows = np.arange(known[turn], known[turn + 1])
        first = rows[(centred[rows] < 0) & (centred[rows + 1] >= 0)][0]
        share = centred[first] / (centred[first] - centred[first + 1])
        times.append(t[first] + share * (t[first + 1] - t[first]))
    if len(times) < 3:
        raise AnalysisError(f"zero crossings need three upward crossings, got {len(times)}")
    steps = np.diff(times)
    number = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
    line = linregress(number, np.array(times))
    return {"frequency": Estimate(1.0 / line.slope, line.stderr / line.slope**2, "Hz")}


def fft_peak(t: F8, y: F8) -> Found:
    """Interpolate the largest line of the discrete Fourier transform by Jacobsen's formula.

    References
    ----------
    E. Jacobsen, P. Kootsookos, "Fast, accurate frequency estimators", IEEE Signal Process. Mag. 24 (2007) 123,
    doi:10.1109/MSP.2007.361611.
    """
    frequency, amplitude, _ = _peak(t, y)
    return {"frequency": Estimate(frequency, math.nan, "Hz"), "amplitude": Estimate(amplitude, math.nan, "m")}


def _peak(t: F8, y: F8) -> tuple[float, float, float]:
    """Frequency, amplitude and phase at t = 0 of the largest line."""
    n = y.size
    centred = y - y.mean()
    lines = np.fft.rfft(centred)
    k = 1 + int(np.argmax(np.abs(lines[1:-1])))
    below = 2.0 * lines[k] - lines[k - 1] - lines[k + 1]
    shift = float(((lines[k - 1] - lines[k + 1]) / below).real) if below != 0 else 0.0
    step = float(t[-1] - t[0]) / (n - 1)
    frequency = (k + min(max(shift, -0.5), 0.5)) / (n * step)
    wave = 2.0 / n * complex(np.sum(centred * np.exp(-2j * math.pi * frequency * t)))
    return frequency, abs(wave), math.atan2(wave.imag, wave.real)


def hilbert(t: F8, y: F8) -> Found:
    """Regress phase and log-amplitude of the analytic signal on time, a twentieth left out at either end."""
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


def matrix_pencil(t: F8, y: F8) -> Found:
    """Find the poles of the decimated record by rotational invariance (ESPRIT), then the amplitude by least squares.

    Notes
    -----
    Block means reduce the record to some eight samples a period, and 1200 at most. The signal subspace has three
    dimensions, a constant and a pair of poles; the pencil is a third of the record, where its variance is least.

    References
    ----------
    Y. Hua, T. K. Sarkar, "Matrix pencil method for estimating parameters of exponentially damped/undamped sinusoids
    in noise", IEEE Trans. Acoust. Speech Signal Process. 38 (1990) 814, doi:10.1109/29.56027.
    """
    coarse = _peak(t, y)[0]
    step = float(t[-1] - t[0]) / (y.size - 1)
    block = max(1, int(1.0 / (8.0 * coarse * step)), -(-y.size // 1200))
    count = y.size // block
    if count < 12:
        raise AnalysisError(f"a matrix pencil needs twelve blocks of samples, got {count}")
    values = y[: count * block].reshape(count, block).mean(axis=1)
    at = t[: count * block].reshape(count, block).mean(axis=1)
    rows = count // 3
    hankel = np.lib.stride_tricks.sliding_window_view(values, count - rows + 1)
    _, vectors = np.linalg.eigh(hankel @ hankel.T)
    signal = vectors[:, -3:]
    poles = np.linalg.eigvals(np.linalg.lstsq(signal[:-1], signal[1:], rcond=None)[0])
    pole = poles[int(np.argmax(np.angle(poles)))]
    gamma, omega = (-np.log(pole) / (block * step)).real, (np.log(pole) / (block * step)).imag
    if not omega > 0:
        raise AnalysisError("the matrix pencil found no pair of poles")
    decay = np.exp(-gamma * (at - at[0]))
    design = np.stack([np.ones(count), decay * np.cos(omega * at), decay * np.sin(omega * at)], axis=1)
    _, cosine, sine = np.linalg.lstsq(design, values, rcond=None)[0]
    # A block's mean is less than its middle's value.
    half = 0.5 * omega * block * step
    shrink = math.sin(half) / (block * math.sin(half / block))
    amplitude = math.hypot(cosine, sine) / shrink * math.exp(gamma * float(at[0] - t[0]))
    return {
        "frequency": Estimate(float(omega) / (2 * math.pi), math.nan, "Hz"),
        "amplitude": Estimate(amplitude, math.nan, "m"),
        "damping_rate": Estimate(float(gamma), math.nan, "1/s"),
    }


def _start(t: F8, y: F8) -> dict[str, float]:
    """Return what a user would start a fit from: a look at the graph and at its spectrum."""
    frequency, amplitude, phase = _peak(t, y)
    return {
        "amplitude": 0.5 * float(np.ptp(y)) if amplitude <= 0 else amplitude,
        "damping_rate": 0.01,
        "frequency": frequency,
        "phase": phase,
        "offset": float(y.mean()),
    }


def _damped_sine(t: F8, amplitude: float, damping_rate: float, frequency: float, phase: float, offset: float) -> F8:
    swing = np.cos(2 * math.pi * frequency * t + phase)
    return np.asarray(offset + amplitude * np.exp(-damping_rate * t) * swing)


def _lmfit(t: F8, y: F8) -> Found:
    """Fit a damped sine by lmfit's default method, started from the spectrum."""
    import lmfit

    fit = lmfit.Model(_damped_sine).fit(y, t=t, **_start(t, y))
    return _fitted({n: (p.value, math.nan if p.stderr is None else p.stderr) for n, p in fit.params.items()})


def _scipy(t: F8, y: F8) -> Found:
    """Fit a damped sine by scipy's curve_fit, started from the spectrum."""
    from scipy.optimize import curve_fit

    start = _start(t, y)
    try:
        values, covariance = curve_fit(_damped_sine, t, y, p0=list(start.values()))
    except RuntimeError as error:
        raise AnalysisError(f"curve_fit: {error}") from error
    return _fitted(dict(zip(start, zip(values, np.sqrt(np.diag(covariance)), strict=True), strict=True)))


def _fitted(values: Mapping[str, Any]) -> Found:
    found = {name: Estimate(float(values[name][0]), float(values[name][1]), unit) for name, unit in UNITS.items()}
    amplitude = found["amplitude"]
    # A negative amplitude is the same motion half a turn on.
    return {**found, "amplitude": Estimate(abs(amplitude.value), amplitude.u, "m")}
