"""Frequency against amplitude, and the spectrum of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN
from pipeline.track import F8, UNUSABLE
from springmass.report.figures.canvas import (
    BLUE,
    ORANGE,
    error_bars,
    legend_above,
    moving,
    panels,
    style,
    value_label,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FrequencyPoints", "frequency_figure", "frequency_points", "spectrum", "spectrum_figure"]

MOST_POINTS = 24
LEAST_WINDOWS = 6  # three stretches of two
SHOWN_MULTIPLES = 8.0  # range of the spectrum in multiples of the oscillation's frequency
LEAST_ROWS = 8
PEAKS = 5  # maximum number of labelled peaks
FALSE_ALARM = 1e-3  # probability that white noise has a labelled peak
SURROUNDINGS = 101  # rows whose median is the noise level around a peak


@dataclass(frozen=True, slots=True)
class FrequencyPoints:
    """Frequencies of stretches of a run.

    Parameters
    ----------
    amplitude : (m,) float64
        Mean amplitude of each stretch, in the recording's unit.
    frequency_hz, u_hz : (m,) float64, Hz
        Slope of the windows' phases in each stretch, and its standard uncertainty.
    """

    amplitude: F8
    frequency_hz: F8
    u_hz: F8


def frequency_points(motion: Oscillation) -> FrequencyPoints | None:
    """Return the frequency in stretches of a run, or None if it has too few windows.

    Parameters
    ----------
    motion : Oscillation

    Notes
    -----
    In each stretch, a straight line is fitted to the phases of its windows, weighted by their inverse variances. The
    variances are multiplied by the reduced chi-square of the whole run's phases if that exceeds one.
    """
    windows = motion.demodulated
    order = np.argsort(windows.t, kind="stable")
    if order.size < LEAST_WINDOWS:
        return None
    rows = []
    widening = max(motion.phase.reduced_chi2, 1.0)
    for part in np.array_split(order, min(MOST_POINTS, order.size // 2)):
        t, phase = windows.t[part], windows.phase[part]
        weight = 1.0 / np.maximum(windows.covariance[part, 1, 1] * widening, 1e-30)
        middle = np.average(t, weights=weight)
        spread = float(np.sum(weight * (t - middle) ** 2))
        slope = float(np.sum(weight * (t - middle) * phase)) / spread
        rows.append((float(np.mean(windows.amplitude[part])), slope / (2 * np.pi), 1 / (2 * np.pi * spread**0.5)))
    return FrequencyPoints(*np.array(rows, np.float64).T)


def frequency_figure(analysis: Analysis) -> Figure | None:
    """Draw the frequency of stretches of the run against their amplitude, and the model of the phase.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a run that oscillates.
    """
    motion = moving(analysis)
    points = frequency_points(motion)
    if points is None:
        return None
    factor = SHOWN[analysis.track.unit].factor
    mean = motion.phase.angular_frequency.value / (2.0 * np.pi)
    with style():
        figure, (panel,) = panels([3.2])
        x = points.amplitude * factor
        shift = 1e3 * (points.frequency_hz - mean)
        error_bars(panel, x, shift, 1e3 * points.u_hz, "a stretch of the run", size=4.0, color=BLUE)
        grid = np.linspace(float(points.amplitude.min()), float(points.amplitude.max()), 100)
        label = "model: the frequency depends on the amplitude" if motion.phase.backbone else "model: one frequency"
        model = 1e3 * (motion.phase.rate(grid) / (2.0 * np.pi) - mean)
        panel.plot(grid * factor, model, color="#000000", lw=1.2, label=label, zorder=1.8)
        seen = np.concatenate([shift, model])
        margin = 0.15 * float(np.ptp(seen)) + 3e3 * float(np.median(points.u_hz))
        panel.set_ylim(float(np.min(seen)) - margin, float(np.max(seen)) + margin)
        panel.set_xlabel(value_label("amplitude", analysis.track.unit))
        panel.set_ylabel(f"(frequency − {mean:.5g} Hz) / mHz")
        legend_above(panel, 2)
        return figure


def spectrum(analysis: Analysis, motion: Oscillation) -> tuple[F8, F8, F8]:
    """Return frequencies in Hz, and the amplitudes of recording and residuals in the recording's unit.

    Notes
    -----
    The discrete Fourier transform with a Hann window is scaled so that a steady sinusoid shows its amplitude. Omitted
    samples and gaps are filled with the fit in the recording, and with zero in the residuals.
    """
    track, waveform = analysis.track, motion.waveform
    used = ((analysis.flags & UNUSABLE) == 0) & np.isfinite(track.y) & np.isfinite(waveform.residual)
    start, end = float(track.t[used][0]), float(track.t[used][-1])
    count = max(round((end - start) * track.rate_hz) + 1, 8)
    grid = np.linspace(start, end, count)
    at = np.clip(np.round((track.t[used] - start) / (end - start) * (count - 1)).astype(np.intp), 0, count - 1)
    residual = np.zeros(count)
    residual[at] = waveform.residual[used]
    whole = motion.rest.at(grid) + motion.damping.best.amplitude(grid - motion.phase.t0) * np.cos(
        motion.phase.total(grid)
    )
    whole[at] = track.y[used]
    window = np.hanning(count)
    scale = 2.0 / window.sum()
    spectra = (scale * np.abs(np.fft.rfft(window * (y - y.mean()))) for y in (whole, residual))
    return np.fft.rfftfreq(count, 1.0 / track.rate_hz), *spectra


def _peaks(amplitude: F8) -> NDArray[np.intp]:
    """Return the rows of peaks that exceed the noise around them, the highest first.

    Notes
    -----
    The amplitudes of white noise have a Rayleigh distribution: with probability
    :math:`\\alpha`, the largest of n exceeds :math:`\\sqrt{\\ln(n/\\alpha)/\\ln 2}` times their median.
    """
    from scipy.ndimage import median_filter

    around = median_filter(amplitude, min(SURROUNDINGS, amplitude.size))
    limit = np.sqrt(np.log(amplitude.size / FALSE_ALARM) / np.log(2.0))
    inner = amplitude[1:-1]
    # scipy.signal has a function for this, but takes half a second to import.
    top = (inner > amplitude[:-2]) & (inner >= amplitude[2:]) & (inner > limit * np.maximum(around[1:-1], 1e-30))
    rows = np.flatnonzero(top) + 1
    return np.asarray(rows[np.argsort(amplitude[rows])[::-1]], np.intp)


def spectrum_figure(analysis: Analysis) -> Figure | None:
    """Draw the spectra of the recording and its residuals, with the frequencies of the highest peaks.

    Parameters
    ----------
    analysis : Analysis
        Analysis of a run that oscillates.
    """
    motion, factor = moving(analysis), SHOWN[analysis.track.unit].factor
    frequency, whole, left = spectrum(analysis, motion)
    keep = (frequency > 0.0) & (frequency <= SHOWN_MULTIPLES * motion.cycles.frequency_hz)
    frequency, whole, left = frequency[keep], whole[keep] * factor, left[keep] * factor
    if frequency.size < LEAST_ROWS:
        return None
    with style():
        figure, (panel,) = panels([3.2])
        dense = frequency.size > 4000
        panel.plot(frequency, whole, color=BLUE, lw=0.8, label="recording", rasterized=dense)
        panel.plot(frequency, left, color=ORANGE, lw=0.7, label="residuals of the fit", rasterized=dense, zorder=1.9)
        panel.set_yscale("log")
        floor = float(np.median(left[left > 0])) if (left > 0).any() else float(whole.max()) * 1e-6
        panel.set_ylim(floor / 20.0, float(whole.max()) * 8.0)
        panel.set_xlim(0.0, float(frequency[-1]))
        best = _peaks(whole)
        taken: list[tuple[float, float]] = []
        width, height = 0.12 * panel.get_xlim()[1], 0.09 * float(np.ptp(np.log(panel.get_ylim())))
        for peak in best[: 4 * PEAKS].tolist():
            at = (float(frequency[peak]), float(np.log(whole[peak])))
            if len(taken) < PEAKS and all(abs(at[0] - x) > width or abs(at[1] - y) > height for x, y in taken):
                taken.append(at)
                panel.annotate(
                    f"{frequency[peak]:.3g} Hz",
                    (frequency[peak], whole[peak]),
                    (0, 4),
                    textcoords="offset points",
                    ha="left" if frequency[peak] < 0.05 * panel.get_xlim()[1] else "center",
                    fontsize=8,
                )
        panel.set_xlabel("frequency / Hz")
        panel.set_ylabel(value_label("amplitude", analysis.track.unit))
        legend_above(panel, 2)
        return figure
