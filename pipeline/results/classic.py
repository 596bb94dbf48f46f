"""Classic: the lab report's own method, reproduced exactly, kept to compare against.

Do not use its results. Against the Cramer-Rao bound of a 10 s record at 0.3 mm noise its period errs 183 times, its
amplitude 42 times; its damping constant is biased by -12 % at 2.39 mm noise and its stated interval covers 0 % of the
truths. The bias of each number is named where the number is made.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.errors import AnalysisError
from pipeline.numerics import least_squares
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import minimise
from pipeline.track import F8, UNUSABLE, Track

__all__ = ["Classic", "classic", "sliding_amplitude"]

STATED_ERROR_M = 0.00239  # the report's error of one distance, from the file's error column
READING_S = 0.01  # the report's error of a time read off the graph, one sample
CYCLES = 7
WINDOW_S = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Classic:
    """The report's Table 1, by the report's arithmetic.

    Parameters
    ----------
    estimates : dict of str to Estimate
        period, frequency, angular_frequency, amplitude, damping_rate, and with masses, disc and velocity
        spring_constant, velocity_rms and reynolds_number.
    window_t, window_amplitude : (m,) float64, s, m
        The sliding amplitude.
    crests_t, crests_y : (8,) float64, s, m
        The sampled maxima: the period is from the first to the last of them.
    extremes : ((t, y), (t, y))
        The least and the greatest distance: half of what lies between them is the amplitude.
    chi2 : float
        Sum of squared deviations of the sliding amplitude from the exponential over the stated error squared.
    """

    estimates: dict[str, Estimate]
    window_t: F8
    window_amplitude: F8
    crests_t: F8
    crests_y: F8
    extremes: tuple[tuple[float, float], tuple[float, float]]
    chi2: float

    def exponential(self) -> F8:
        """Return the exponential that the report fits, at the windows' times, m."""
        since = self.window_t - self.window_t[0]
        return np.asarray(self.window_amplitude[0] * np.exp(-self.estimates["damping_rate"].value * since))


def classic(track: Track, scene: Scene | None = None) -> Classic:
    """Evaluate a run as the report did.

    Parameters
    ----------
    track : Track
        Flagged samples are left out only where they carry no distance; the report knew no false echoes.
    scene : Scene, optional

    Returns
    -------
    Classic

    Raises
    ------
    AnalysisError
        If fewer than eight sampled maxima are there, or the record is shorter than one window.
    TrackError
        If the track is no length.

    Notes
    -----
    Period (eqs. 13, 18): time from one sampled maximum to the seventh after it, over seven, with
    :math:`u = 0.01/7` s. Two samples decide where a thousand could, so it errs 58 to 183 times the bound.

    Amplitude (eq. 17): :math:`(y_\\mathrm{max} - y_\\mathrm{min})/2`. Extremes of noisy samples lie outside the motion:
    biased by +0.56 mm at 0.3 mm noise and by +5.4 mm at 2.39 mm, and every false echo enters. Uncertainty
    :math:`u/\\sqrt 2` of the stated 2.39 mm.

    Amplitude against time (eq. 22): half the range over 1.5 s, stamped at the window's start, at every sample: about
    1.2 sigma too large, early by part of a window, and 150 neighbouring points share their samples, so a fit to them
    misstates its interval.

    Damping (eqs. 24, 27): unweighted :math:`A_0 e^{-\\gamma t}` with :math:`A_0` fixed at the first window's amplitude:
    one point's error becomes the slope's, and an exponential is assumed where drag is mixed. Together the bias is
    -12 % at 2.39 mm noise.
    """
    track.demand_length("the classic method")
    scene = scene or Scene()
    there = np.isfinite(track.y) & np.isfinite(track.t) & ((track.flags & UNUSABLE) == 0)
    t, y = track.t[there], track.y[there]
    if t.size < 2:
        raise AnalysisError(f"the classic method needs distances, got {t.size} of {len(track)} samples; record longer")
    estimates: dict[str, Estimate] = {}
    crests = _crests(t, y)
    period = Estimate(float(t[crests[-1]] - t[crests[0]]) / CYCLES, READING_S / CYCLES, "s")
    estimates["period"] = period
    frequency = Estimate(1.0 / period.value, period.u / period.value**2, "Hz")
    estimates["frequency"] = frequency
    omega = Estimate(2 * math.pi * frequency.value, 2 * math.pi * frequency.u, "rad/s")
    estimates["angular_frequency"] = omega
    amplitude = 0.5 * float(np.ptp(y))
    estimates["amplitude"] = Estimate(amplitude, STATED_ERROR_M / math.sqrt(2.0), "m")
    window_t, window_amplitude = sliding_amplitude(t, y, WINDOW_S)
    gamma, u_gamma = _exponential(window_t - window_t[0], window_amplitude)
    estimates["damping_rate"] = Estimate(gamma, u_gamma, "1/s")
    fitted = window_amplitude[0] * np.exp(-gamma * (window_t - window_t[0]))
    chi2 = float(np.sum(((window_amplitude - fitted) / STATED_ERROR_M) ** 2))
    if scene.bob_mass_kg is not None:
        mass = scene.bob_mass_kg
        k = omega.value**2 * mass.value
        relative = math.hypot(2 * omega.u / omega.value, mass.u / mass.value)
        estimates["spring_constant"] = Estimate(k, k * relative, "N/m")
    if track.velocity is not None and np.isfinite(track.velocity).any():
        _add_velocity(estimates, track.velocity[np.isfinite(track.velocity)], scene)
    lowest, highest = int(np.argmin(y)), int(np.argmax(y))
    extremes = (float(t[lowest]), float(y[lowest])), (float(t[highest]), float(y[highest]))
    return Classic(estimates, window_t, window_amplitude, t[crests], y[crests], extremes, chi2)


def sliding_amplitude(t: F8, y: F8, window_s: float) -> tuple[F8, F8]:
    """Return half the range over [t, t + window], at every sample that has a whole window after it.

    Parameters
    ----------
    t, y : (n,) float64, s, m
        t increases.
    window_s : float

    Returns
    -------
    t, amplitude : (m,) float64, s, m

    Raises
    ------
    AnalysisError
        If the record is shorter than the window.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    step = float(np.median(np.diff(t)))
    width = round(window_s / step) + 1
    if width > y.size:
        raise AnalysisError(
            f"the classic method slides a window of {window_s:g} s, the record lasts {t[-1] - t[0]:.3g} s; "
            "record longer"
        )
    count = y.size - width + 1
    # A filter's window lies about its sample: the first whole one about sample width // 2.
    whole = slice(width // 2, width // 2 + count)
    half_range = 0.5 * (maximum_filter1d(y, width) - minimum_filter1d(y, width))
    return t[:count], half_range[whole]


def _crests(t: F8, y: F8) -> list[int]:
    """Return the rows of the first sampled maximum and the seven after it."""
    middle = 0.5 * (float(y.max()) + float(y.min()))
    above = y > middle
    rises = np.flatnonzero(~above[:-1] & above[1:]) + 1
    falls = np.flatnonzero(above[:-1] & ~above[1:]) + 1
    crests: list[int] = []
    for rise in rises:
        after = falls[falls > rise]
        if after.size:
            crest = int(rise) + int(np.argmax(y[rise : after[0]]))
            # Noise at the crossing makes runs of a few samples; an eye sees one crest.
            if not crests or t[crest] - t[crests[-1]] > 0.2:
                crests.append(crest)
    if len(crests) <= CYCLES:
        raise AnalysisError(
            f"the classic method needs {CYCLES + 1} maxima, the record shows {len(crests)}; record longer"
        )
    return crests[: CYCLES + 1]


def _exponential(t: F8, amplitude: F8) -> tuple[float, float]:
    """Fit only gamma by unweighted least squares; return it with the uncertainty from the covariance of the fit."""
    start = float(amplitude[0])

    def residuals(theta: F8) -> F8:
        return np.asarray(start * np.exp(-theta[0] * t) - amplitude)

    def jacobian(theta: F8) -> F8:
        return np.asarray(-start * t * np.exp(-theta[0] * t))[:, None]

    fit = minimise(residuals, [0.0], jacobian, least_squares.Params(precision=1e-9))
    if not fit.converged:
        return float(fit.values[0]), math.inf
    return float(fit.values[0]), math.sqrt(fit.cost / max(t.size - 1, 1) * float(fit.covariance[0, 0]))


def _add_velocity(estimates: dict[str, Estimate], velocity: F8, scene: Scene) -> None:
    """Add root mean square of the recorded velocity and Reynolds number (eqs. 25, 26), constants as in the report."""
    rms = math.sqrt(float(np.mean(velocity**2)))
    # Eq. 25 as evaluated: its "deviation" of v^2, 0.03266 m^2/s^2, is the mean, and it divides by N, not by the root.
    u_rms = rms / (2.0 * velocity.size)
    estimates["velocity_rms"] = Estimate(rms, u_rms, "m/s")
    if scene.disc_diameter_m is not None:
        per_area = 1.204 / 1.825e-5
        length = scene.disc_diameter_m
        value = per_area * rms * length.value
        u = value * math.hypot(u_rms / rms, length.u / length.value) if rms > 0 else math.inf
        estimates["reynolds_number"] = Estimate(value, u)
