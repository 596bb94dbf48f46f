"""Classic: the method of the lab report, reproduced exactly for comparison.

Do not use its results. For a 10 s record with 0.3 mm noise, the error of its period is 183 times the Cramer-Rao bound
and that of its amplitude 42 times. At 2.39 mm noise its damping constant is biased by -12 %, and its stated interval
never covers the true value. :func:`classic` describes the bias of each number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bench.scene import Scene
from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.least_squares import minimise
from pipeline.track import F8, UNUSABLE, Track

# Of the lab report, whose printed values tests/unit/pipeline/test_golden.py reproduces: the error of one distance from
# the error column of its file, the error of a time read from its graph (one sample), the cycles that it timed, and the
# window over which it took half of the range.
STATED_ERROR_M, READING_S, CYCLES, WINDOW_S = 0.00239, 0.01, 7, 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Classic:
    """Table 1 of the report, calculated as in the report."""

    # Period, frequency, angular_frequency, amplitude and damping_rate. Also spring_constant if the mass of the bob is
    # stated, velocity_rms if velocities are recorded, and reynolds_number if the disc is stated as well.
    estimates: dict[str, Estimate]
    # window_t, window_amplitude: (m,) s, m, the sliding amplitude.
    window_t: F8
    window_amplitude: F8
    # crests_t, crests_y: (8,) s, m, the sampled maxima: seven periods pass from the first to the last.
    crests_t: F8
    crests_y: F8
    # The smallest and the largest distance: the amplitude is half of their difference.
    extremes: tuple[tuple[float, float], tuple[float, float]]
    # Sum of squared deviations of the sliding amplitude from the exponential, over the square of the stated error.
    chi2: float

    def exponential(self) -> F8:
        """Return the exponential fitted as in the report, m, at the times of the windows."""
        since = self.window_t - self.window_t[0]
        return np.asarray(self.window_amplitude[0] * np.exp(-self.estimates["damping_rate"].value * since))


def classic(track: Track, scene: Scene | None = None) -> Classic:
    """Evaluate a run as in the report.

    Period (eqs. 13, 18): time from one sampled maximum to the seventh after it, over seven, with :math:`u = 0.01/7` s.
    Only two of about a thousand samples determine it, so its error is 58 to 183 times the bound.

    Amplitude (eq. 17): :math:`(y_\\mathrm{max} - y_\\mathrm{min})/2`, with the uncertainty :math:`u/\\sqrt 2` for the
    stated error u of 2.39 mm. Extremes of noisy samples lie outside the motion: the bias is +0.56 mm at 0.3 mm noise
    and +5.4 mm at 2.39 mm, and false echoes enter it.

    Amplitude against time (eq. 22): half the range over 1.5 s, at the time of the window's start, for every sample. It
    is about 1.2 sigma too large and too early, and its neighbouring points share samples.

    Damping (eqs. 24, 27): unweighted fit of :math:`A_0 e^{-\\gamma t}` with :math:`A_0` fixed at the amplitude of the
    first window, although drag is mixed. The bias is -12 % at 2.39 mm noise.
    """
    track.demand_length("the classic method")
    scene = scene or Scene()
    there = np.isfinite(track.y) & np.isfinite(track.t) & ((track.flags & UNUSABLE) == 0)
    t, y = track.t[there], track.y[there]
    if t.size < 2:
        raise AnalysisError(
            f"the classic method needs distances, got {t.size} of {len(track)} samples", "record longer"
        )
    crests = _crests(t, y)
    period = Estimate(float(t[crests[-1]] - t[crests[0]]) / CYCLES, READING_S / CYCLES, "s")
    window_t, window_amplitude = sliding_amplitude(t, y, WINDOW_S)
    since = window_t - window_t[0]
    gamma, u_gamma = _exponential(since, window_amplitude)
    estimates = {
        "period": period,
        "frequency": Estimate.of_variable(1.0 / period, "Hz"),
        "angular_frequency": Estimate.of_variable(2.0 * math.pi / period, "rad/s"),
        "amplitude": Estimate(0.5 * float(np.ptp(y)), STATED_ERROR_M / math.sqrt(2.0), "m"),
        "damping_rate": Estimate(gamma, u_gamma, "1/s"),
    }
    chi2 = float(np.sum(((window_amplitude - window_amplitude[0] * np.exp(-gamma * since)) / STATED_ERROR_M) ** 2))
    if scene.bob_mass_kg is not None:
        constant = scene.bob_mass_kg * (2.0 * math.pi / period) ** 2
        estimates["spring_constant"] = Estimate.of_variable(constant, "N/m")
    if track.velocity is not None and np.isfinite(track.velocity).any():
        velocity = track.velocity[np.isfinite(track.velocity)]
        rms = math.sqrt(float(np.mean(velocity**2)))
        # Eq. 25 as evaluated: its "deviation" of v^2, 0.03266 m^2/s^2, is the mean, and it divides by N, not sqrt(N).
        estimates["velocity_rms"] = speed = Estimate(rms, rms / (2.0 * velocity.size), "m/s")
        if scene.disc_diameter_m is not None:  # eq. 26, with the report's constants
            estimates["reynolds_number"] = Estimate.of_variable(1.204 / 1.825e-5 * (scene.disc_diameter_m * speed), "")
    lowest, highest = int(np.argmin(y)), int(np.argmax(y))
    extremes = (float(t[lowest]), float(y[lowest])), (float(t[highest]), float(y[highest]))
    return Classic(
        estimates=estimates,
        window_t=window_t,
        window_amplitude=window_amplitude,
        crests_t=t[crests],
        crests_y=y[crests],
        extremes=extremes,
        chi2=chi2,
    )


def sliding_amplitude(t: F8, y: F8, window_s: float) -> tuple[F8, F8]:
    """Return half the range over [t, t + window] at every sample that is followed by a whole window."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    step = float(np.median(np.diff(t)))
    width = round(window_s / step) + 1
    if width > y.size:
        raise AnalysisError(
            f"the classic method slides a window of {window_s:g} s, the record lasts {t[-1] - t[0]:.3g} s",
            "record longer",
        )
    count = y.size - width + 1
    # The window of a filter is centred on its sample: the first whole window on sample width // 2.
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
            # Noise at a crossing makes short runs above the middle; they belong to one crest.
            if not crests or t[crest] - t[crests[-1]] > 0.2:
                crests.append(crest)
    if len(crests) <= CYCLES:
        raise AnalysisError(
            f"the classic method needs {CYCLES + 1} maxima, the record shows {len(crests)}", "record longer"
        )
    return crests[: CYCLES + 1]


def _exponential(t: F8, amplitude: F8) -> tuple[float, float]:
    """Fit only gamma by unweighted least squares; return gamma and its uncertainty from the covariance of the fit."""
    start = float(amplitude[0])

    def residuals(theta: F8) -> F8:
        return np.asarray(start * np.exp(-theta[0] * t) - amplitude)

    fit = minimise(residuals, [0.0], precision=1e-9)
    if not fit.converged:
        return float(fit.values[0]), math.inf
    return float(fit.values[0]), math.sqrt(fit.cost / max(t.size - 1, 1) * float(fit.covariance[0, 0]))
