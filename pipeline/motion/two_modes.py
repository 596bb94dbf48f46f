"""Two modes of like strength: a motion of two oscillations together, both of which can be named."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.instrument import U_CRYSTAL
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import minimise
from pipeline.numerics.quantity import amount
from pipeline.numerics.regression import correlation_length
from pipeline.samples.condition import Conditioned
from pipeline.track import F8

__all__ = ["Params", "TwoModes", "find_two_modes"]

ROUNDING = 64.0 * float(np.finfo(np.float64).eps)  # of the values: what a still record scatters by


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_two_modes`.

    Parameters
    ----------
    left : float
        Share of the variance that two modes may leave.
    weaker : float
        Of the stronger mode's amplitude; with less the stronger one is the oscillation.
    beats, periods : float
        Beats and periods of the slower mode that the record must have to distinguish two modes from one that changes.
    most : int
        Longer records are not fitted.
    thin : float
        Sample intervals that a sample may stand for on average.
    """

    left: float = 0.1
    weaker: float = 1.0 / 3.0
    beats: float = 0.8
    periods: float = 3.0
    most: int = 100_000
    thin: float = 50.0


@dataclass(frozen=True, slots=True)
class TwoModes:
    """Two oscillations that run together.

    Parameters
    ----------
    why : str
        One sentence that names them.
    estimates : mapping of str to Estimate
        ``first_mode_period``, ``first_mode_amplitude`` at the first sample, and the second's; the stronger is first.
    """

    why: str
    estimates: dict[str, Estimate]


def find_two_modes(conditioned: Conditioned, params: Params | None = None) -> TwoModes | None:
    """Return the two modes that a record consists of; None where two do not describe it.

    Parameters
    ----------
    conditioned : Conditioned
    params : Params, optional

    Notes
    -----
    Least squares of :math:`o + \\sum_i e^{-g_i t}(a_i\\cos\\omega_i t + b_i\\sin\\omega_i t)` through all samples used,
    from the strongest line of the spectrum and that of what the first leaves. Covariances are by the residuals, with
    their correlation. Longer records, and samples strewn thinly over their time, are not searched.
    """
    params = params or Params()
    used = conditioned.used & np.isfinite(conditioned.track.t)
    t, y, unit = conditioned.track.t[used], conditioned.track.y[used], conditioned.track.unit
    tau, span = t - t[0], float(t[-1] - t[0])
    scale = float(np.std(y))
    if (
        not 32 <= y.size <= params.most
        or scale <= ROUNDING * float(np.max(np.abs(y)))
        or not 0.0 < span < params.thin * y.size * float(np.median(np.diff(t)))
    ):
        return None
    values = (y - y.mean()) / scale
    first = _strongest(tau, values)
    second = _strongest(tau, values - _model(_linear(tau, values, (first,)), tau)[0])
    start = _linear(tau, values, (first, second))
    fit = minimise(lambda x: _model(x, tau)[0] - values, start, lambda x: _model(x, tau)[1])
    if not np.all(np.isfinite(fit.covariance)) or not float(fit.residual @ fit.residual) < params.left * y.size:
        return None
    places = sorted((1, 5), key=lambda i: -float(np.hypot(*fit.values[i : i + 2])))
    omegas = [abs(float(fit.values[i + 2])) for i in places]
    sizes = [float(np.hypot(*fit.values[i : i + 2])) for i in places]
    beats = abs(omegas[0] - omegas[1]) * span / (2.0 * math.pi)
    if (
        min(omegas) * span < 2.0 * math.pi * params.periods
        or beats < params.beats
        or sizes[1] < params.weaker * sizes[0]
    ):
        return None
    slow, fast = sorted(omegas)
    # What keeps step with the other is no mode but its shape: a signal that switches, say.
    if round(fast / slow) > 1 and abs(fast - round(fast / slow) * slow) * span < math.pi:
        return None
    widened = float(fit.residual @ fit.residual) / max(y.size - 9, 1) * correlation_length(fit.residual)
    u = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0) * widened)
    found = {}
    for name, i, omega, size in zip(("first", "second"), places, omegas, sizes, strict=True):
        period = 2.0 * math.pi / omega
        relative = math.hypot(float(u[i + 2]) / omega, U_CRYSTAL)
        found[f"{name}_mode_period"] = Estimate(period, period * relative, "s")
        found[f"{name}_mode_amplitude"] = Estimate(scale * size, scale * float(np.max(u[i : i + 2])), unit)
    descriptions = [
        f"{found[f'{name}_mode_period']} ({amount(found[f'{name}_mode_amplitude'].value, unit)})"
        for name in ("first", "second")
    ]
    why = f"two modes of like strength oscillate together, at periods of {descriptions[0]} and {descriptions[1]}: "
    return TwoModes(f"{why}they beat every {span / beats:.3g} s", found)


def _strongest(tau: F8, values: F8) -> float:
    """Angular frequency of the strongest line, rad/s, of samples that need not be equally spaced."""
    step = float(np.median(np.diff(tau)))
    grid = np.arange(int(tau[-1] / step) + 1) * step
    power = np.abs(np.fft.rfft(np.interp(grid, tau, values), 8 * grid.size)) ** 2
    least = 8  # slower than one period per record is drift
    peak = least + int(np.argmax(power[least:]))
    return 2.0 * math.pi * peak / (8 * grid.size * step)


def _linear(tau: F8, values: F8, omegas: tuple[float, ...]) -> F8:
    """Parameters of undamped modes of these frequencies: rest position, then a, b, omega and g of each."""
    waves = [wave(omega * tau) for omega in omegas for wave in (np.cos, np.sin)]
    solved = np.linalg.lstsq(np.stack([np.ones_like(tau), *waves], axis=1), values, rcond=None)[0]
    each = [[solved[1 + 2 * i], solved[2 + 2 * i], omega, 0.0] for i, omega in enumerate(omegas)]
    return np.concatenate([solved[:1], *each])


def _model(x: F8, tau: F8) -> tuple[F8, F8]:
    """The motion (n,) and its derivatives (n, 1 + 4 m) by the parameters of m modes."""
    total, slopes = np.full(tau.size, x[0]), [np.ones_like(tau)]
    for a, b, omega, g in x[1:].reshape(-1, 4):
        fall = np.exp(-np.clip(g * tau, -20.0, 200.0))
        cosine, sine = fall * np.cos(omega * tau), fall * np.sin(omega * tau)
        wave = a * cosine + b * sine
        total = total + wave
        slopes += [cosine, sine, tau * (b * cosine - a * sine), -tau * wave]
    return total, np.stack(slopes, axis=1)
