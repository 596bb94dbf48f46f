"""Dialects met in public: what oscillates has the period that scipy finds; the goldens hold what is read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from pipeline.analyse import Analysis, analyse
from pipeline.track import UNUSABLE
from springmass.loading.loaded import Loaded
from tests.sampling import sampled

Given = dict[str, Any]

# Files in which something oscillates, by the start of their name, with the answers to what they leave out.
OSCILLATE = [
    ("cassycsv", {"channel": "Weg &b_A1"}),
    ("chartrec", {}),
    ("coupled", {"channel": "x_rojo", "unit": "mm"}),
    ("datcsv", {}),
    ("heidelberg", {"channel": "column 2", "unit": "cm"}),
    ("microbit__ES2Spring2019-ComputinginEngineering__L13", {"channel": "column 1", "unit": "m/s2", "time_unit": "ms"}),
    (
        "microbit__ES2Spring2019-ComputinginEngineering__data",
        {"channel": "column 2", "unit": "m/s2", "time_unit": "ms"},
    ),
    ("moku", {"channel": "Input A"}),
    ("picoscope", {"channel": "Kanal A"}),
    ("plasduino", {"channel": "Pos B", "unit": "mm"}),
    ("qpd", {"channel": "leftMinusRight", "unit": "V"}),
    ("runhead", {"channel": "LR_Signal", "unit": "V"}),
    ("scope", {}),
    ("tdisp", {"unit": "cm", "run": "2"}),
    ("terr", {"unit": "rad"}),
    ("tnames", {}),
    ("tracker", {"unit": "rad"}),
    ("trkerr", {"unit": "deg"}),
    ("tunit", {}),
    ("labx", {}),
    ("trk__", {"channel": "x"}),
    ("xyerr", {"unit": "m"}),
]


def only(recordings: Path, start: str) -> Path:
    """Return the one file under wild/ of that name."""
    (path,) = (each for each in (recordings / "wild").iterdir() if each.name.startswith(start))
    return path


def analysed(path: Path, given: Given) -> tuple[Analysis, np.ndarray, np.ndarray]:
    """Return the analysis, and the times and values that it used."""
    recording = open_recording(path, ReadOptions.of(given))
    found = analyse(Loaded(recording, recording.format).track)
    used = (found.flags & UNUSABLE) == 0
    return found, recording.samples.t[used], recording.samples.distance[used]


def independent_period(t: np.ndarray, y: np.ndarray) -> float:
    """Return the period by scipy alone: a robust fit of a damped sinusoid on a straight line, from the spectrum's peak.

    The whole record is one fit; nothing is cut into windows, and no law is chosen.
    """
    from scipy.optimize import least_squares
    from scipy.signal import detrend

    known = np.isfinite(t) & np.isfinite(y)
    t, y = t[known] - t[known][0], y[known]
    y = (y - np.median(y)) / np.std(y)
    span, step = float(t[-1]), float(np.median(np.diff(t)))
    grid = np.arange(int(span / step)) * step
    power = np.abs(np.fft.rfft(detrend(np.interp(grid, t, y)) * np.hanning(grid.size), 8 * grid.size))
    rates = np.fft.rfftfreq(8 * grid.size, step)
    omega = 2.0 * np.pi * rates[np.argmax(np.where(rates > 1.5 / span, power, 0.0))]
    waves = np.stack([np.ones_like(t), t / span, np.cos(omega * t), np.sin(omega * t)], axis=1)
    start = np.linalg.lstsq(waves, y, rcond=None)[0]

    def left(x: np.ndarray) -> np.ndarray:
        fall = np.exp(-np.clip(x[5] * t / span, -5.0, 50.0))
        angle = (omega + x[4] / span) * t
        return x[0] + x[1] * t / span + fall * (x[2] * np.cos(angle) + x[3] * np.sin(angle)) - y

    ends = [least_squares(left, [*start, 0.0, rate], loss="soft_l1", f_scale=0.1) for rate in (0.0, 1.0, 4.0)]
    best = min(ends, key=lambda end: float(end.cost))
    return float(2.0 * np.pi / (omega + best.x[4] / span))


@pytest.mark.parametrize(("start", "given"), sampled(OSCILLATE, 9))
def test_what_oscillates_has_the_period_of_an_independent_fit(recordings: Path, start: str, given: Given) -> None:
    """Of the same rows: within three standard uncertainties and, as pendulums follow their amplitude, 0.02 %."""
    found, t, y = analysed(only(recordings, start), given)
    period, expected = found.estimates["period"], independent_period(t, y)
    assert abs(period.value - expected) < 3.0 * period.u + 2e-4 * expected
    assert period.u < 5e-3 * period.value


def test_of_two_strokes_the_last_gives_the_period(recordings: Path) -> None:
    """A carriage is driven forth and back and swings after each; its crossings of the last rest say the period."""
    found, t, y = analysed(only(recordings, "ecp"), {"channel": "Encoder 1 Pos", "unit": "mm"})
    y = y - np.median(y[-100:])
    last = np.flatnonzero((t[:-1] > 3.05) & (t[:-1] < 3.65) & (y[1:] * y[:-1] < 0.0))
    crossed = t[last] - y[last] * (t[last + 1] - t[last]) / (y[last + 1] - y[last])
    period = found.estimates["period"]
    assert abs(period.value - 2.0 * float(np.mean(np.diff(crossed)))) < 2.0 * period.u
    assert {"handled", "short_record"} <= {each.code for each in found.findings}
