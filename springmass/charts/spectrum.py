"""The spectrum of a run and of the residuals of its fit, and the peaks that stand out of the noise."""

from __future__ import annotations

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.track import F8, UNUSABLE

SHOWN_MULTIPLES = 8.0  # range of the spectrum in multiples of the oscillation's frequency
LEAST_ROWS = 8
MOST_PEAKS, MOST_TRIED = 5, 200
FALSE_ALARM = 1e-3  # probability that white noise has a labelled peak
SURROUNDINGS = 101  # rows whose median is the noise level around a peak
APART = 0.03  # of the range of frequencies; of two peaks that are nearer, the higher is labelled


def spectrum_of(a: Analysis, motion: Oscillation) -> tuple[F8, F8, F8] | None:
    """Return frequencies in Hz, and the amplitudes of recording and residuals in the recording's unit.

    The discrete Fourier transform with a Hann window is scaled so that a steady sinusoid shows its amplitude. Omitted
    samples and gaps are filled with the fit in the recording, and with zero in the residuals.
    """
    track, waveform = a.track, motion.waveform
    used = ((a.flags & UNUSABLE) == 0) & np.isfinite(track.y) & np.isfinite(waveform.residual)
    start, end = float(track.t[used][0]), float(track.t[used][-1])
    count = max(round((end - start) * track.rate_hz) + 1, 8)
    grid = np.linspace(start, end, count)
    at = np.clip(np.round((track.t[used] - start) / (end - start) * (count - 1)).astype(np.intp), 0, count - 1)
    residual = np.zeros(count)
    residual[at] = waveform.residual[used]
    swing = motion.damping.best.amplitude(grid - motion.phase.t0) * np.cos(motion.phase.total(grid))
    whole = motion.rest.at(grid) + swing
    whole[at] = track.y[used]
    window = np.hanning(count)
    scale = 2.0 / window.sum()
    f: F8 = np.asarray(np.fft.rfftfreq(count, 1.0 / track.rate_hz), np.float64)
    keep = (f > 0.0) & (f <= SHOWN_MULTIPLES * motion.cycles.frequency_hz)
    if np.count_nonzero(keep) < LEAST_ROWS:
        return None
    whole, residual = (scale * np.abs(np.fft.rfft(window * (y - y.mean())))[keep] for y in (whole, residual))
    return f[keep], whole, residual


def peaks_of(amplitude: F8) -> list[int]:
    """Return the rows of the highest peaks that exceed the noise around them.

    The amplitudes of white noise have a Rayleigh distribution: with probability :math:`\\alpha`, the largest of n
    exceeds :math:`\\sqrt{\\ln(n/\\alpha)/\\ln 2}` times their median.
    """
    limit = np.sqrt(np.log(amplitude.size / FALSE_ALARM) / np.log(2.0))
    inner = amplitude[1:-1]
    # scipy has functions for both, but they take longer to import than all charts take to make.
    tops = np.flatnonzero((inner > amplitude[:-2]) & (inner >= amplitude[2:])) + 1
    taken: list[int] = []
    for row in tops[np.argsort(amplitude[tops])[::-1]][:MOST_TRIED].tolist():
        noise = float(np.median(amplitude[max(row - SURROUNDINGS // 2, 0) : row + SURROUNDINGS // 2 + 1]))
        alone = all(abs(row - other) > APART * amplitude.size for other in taken)
        if len(taken) < MOST_PEAKS and alone and amplitude[row] > limit * max(noise, 1e-30):
            taken.append(row)
    return taken
