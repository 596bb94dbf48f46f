"""Repeated analysis of the samples so far, in a thread; the server never waits for it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import AcquisitionError
from acquisition.recordings.recording import Trap
from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from pipeline.options import options_for
from pipeline.track import F8, Track
from springmass.errors import ProgramError
from springmass.page.stopping import ALPHA, more_seconds, widening
from springmass.page.view import View, json_of
from springmass.runs.analysing import AnalysedRun, analyse_track, load_and_analyse, with_law
from springmass.runs.loading import between
from storage.errors import StorageError

__all__ = ["Watcher", "drawn", "motion_of"]

LIVE_TIER, WHOLE_TIER = "fast", "standard"
"""Tiers of the analysis during a recording, and of a complete run; the latter is the default of every command."""
SHARE, NOW_SHARE = 0.03, 0.02
"""Maximum fraction of a core for analyses of all samples, and for those of the last seconds; together 5 %."""
NOW_S, NOW_SWINGS = 10.0, 8.0
"""Duration of the samples for the current amplitude, in seconds and in swings; the longer duration counts."""
LEAST_WAIT_S = 1.0
NAMES = ("period", "spring_constant", "damping_rate", "noise", "offset", "quality_factor")
CURVE_POINTS = 200
FIT_BEFORE_S, FIT_AFTER_S, FIT_POINTS = 40.0, 60.0, 101
"""Time range of the latest fit before and after its last window in s, and its number of points."""
LAST_WINDOWS = 4
U_CLOCK_REACH = 2.0
"""Coverage factor of the clock's rate error, which is unknown but constant and independent of the stopping time."""
WANTED = 4e-5
"""Wanted u relative to the period: a little above the u of a 50 ppm crystal, so that it can be reached."""
MOST_POINTS = 600
"""Maximum number of amplitudes in a message."""
SPECTRUM_SAMPLES = 1 << 13
SPECTRUM_POINTS = 1024
MAIN_LOBE = 4
"""Width of a spectral line under a Hann window, in frequency steps."""
NEIGHBOURS = 129
"""Frequencies whose median estimates the noise level; due to its scatter, 2 of 800 white-noise spectra have a peak."""
PEAK_FALSE_ALARM = 1e-3
MOST_PEAKS = 5


def motion_of(
    track: Track,
    scene: Scene,
    wanted_u_s: float | None = None,
    traps: Sequence[Trap] = (),
    *,
    law: str | None = None,
    accuracy: str = LIVE_TIER,
) -> dict[str, Any]:
    """Analyse samples and return the message about their motion.

    Parameters
    ----------
    track : Track
    scene : Scene
    wanted_u_s : float, optional
        Standard uncertainty of the period to reach, s; default: 40 ppm of the period.
    traps : sequence of Trap
        Traps that the reader found in the file.
    law : str, optional
        Stated damping law, as :func:`springmass.runs.analysing.with_law` takes it.
    accuracy : {"fast", "standard", "best"}
        Tier of the analysis; the message names it.
    """
    options = with_law(options_for(accuracy), law)
    return _message(lambda: analyse_track(track, scene, options, traps), track, accuracy, wanted_u_s)


def _message(analyse: Callable[[], Analysis], track: Track, accuracy: str, wanted_u_s: float | None) -> dict[str, Any]:
    """Return the message about an analysis, or about the reason why there is none."""
    message: dict[str, Any] = {
        "type": "motion",
        "why": "",
        "accuracy": accuracy,
        "t_s": float(np.nanmax(track.t)) if np.isfinite(track.t).any() else None,
        "spectrum": spectrum(track),
    }
    try:
        analysis = analyse()
    except PipelineError as error:
        return {**message, "why": str(error)}
    message["findings"] = [
        {"code": f.code, "severity": f.severity, "message": f.message, "advice": f.advice}
        for f in analysis.findings
        if f.severity != "info"
    ]
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return {**message, "why": motion.why, "estimates": _estimates(analysis)}
    return {**message, **_oscillation(analysis, motion, wanted_u_s)}


def _estimates(analysis: Analysis) -> dict[str, dict[str, Any]]:
    found = {name: analysis.estimates[name] for name in NAMES if name in analysis.estimates}
    return {name: _in_message(each) for name, each in {**found, **_sampling(analysis.track)}.items()}


def _sampling(track: Track) -> dict[str, Estimate]:
    """Return the sampling rate in Hz and the fraction of missing samples in %.

    The u of the rate combines the u of the clock with the scatter of the times. The u of the fraction is the standard
    deviation of its posterior under Jeffreys' prior: a few samples without a missing one do not prove that the fraction
    is zero.
    """
    steps = np.diff(track.t[np.isfinite(track.t)])
    n, missing = len(track), int(np.count_nonzero(np.isnan(track.y)))
    found = {}
    if steps.size > 1 and (span := float(steps.sum())) > 0.0:
        clock = Instrument.of(track).clock_rate
        rate = steps.size / span * clock.value
        found["sample_rate"] = Estimate(
            rate, rate * math.hypot(clock.u / clock.value, float(np.std(steps)) / span), "Hz"
        )
    a, b = missing + 0.5, n - missing + 0.5
    u_share = math.sqrt(a * b / (a + b + 1.0)) / (a + b)
    return {**found, "drop_outs": Estimate(100.0 * missing / n, 100.0 * u_share, "%")}


def _oscillation(analysis: Analysis, motion: Oscillation, aim_s: float | None) -> dict[str, Any]:
    damping, windows = motion.damping, motion.demodulated
    kept = np.flatnonzero(damping.scatter.kept)
    drawn_rows = kept[:: -(-kept.size // MOST_POINTS)]
    start, end = damping.t0, float(np.nanmax(analysis.track.t))
    times = np.linspace(start, end, CURVE_POINTS)
    estimates = _estimates(analysis)
    if (now := _now(windows.amplitude[kept], damping.scatter.u[kept])) is not None:
        estimates["amplitude_now"] = _in_message(now)
    period, frequency = analysis.estimates["period"], motion.phase.angular_frequency
    wanted_u_s = WANTED * period.value if aim_s is None else aim_s
    # The uncertainty from the samples shrinks as the recording grows; that from the sensor's clock does not.
    u_samples = min(period.value * frequency.u / frequency.value, period.u)
    u_clock = math.sqrt(period.u**2 - u_samples**2)
    wanted_u_samples_s = math.sqrt(wanted_u_s**2 - u_clock**2) if wanted_u_s > u_clock else None
    reach = math.hypot(widening(u_samples, wanted_u_samples_s or wanted_u_s) * u_samples, U_CLOCK_REACH * u_clock)
    need = math.inf
    if wanted_u_samples_s is not None:
        need = more_seconds(u_samples, wanted_u_samples_s, end - start, damping.best.amplitude)
    return {
        "estimates": estimates,
        "amplitude": {
            "t": drawn(windows.t[drawn_rows]),
            "value": drawn(windows.amplitude[drawn_rows]),
            "u": drawn(damping.scatter.u[drawn_rows]),
        },
        "laws": [
            {"name": name, "t": drawn(times), "value": drawn(fit.amplitude(times - damping.t0))}
            for name, fit in damping.considered.items()
        ],
        "law": damping.selected,
        "stated_law": damping.stated,
        "settled": damping.settled,
        "rest_m": analysis.estimates["offset"].value,
        "omega": analysis.estimates["angular_frequency"].value,
        "fit": _latest_fit(motion, end),
        "stop": {
            "wanted_u_s": wanted_u_s,
            "u_s": period.u,
            "u_samples_s": u_samples,
            "u_clock_s": u_clock,
            "covers": 1.0 - ALPHA,
            "low": period.value - reach,
            "high": period.value + reach,
            "more_s": need if math.isfinite(need) else None,
        },
    }


def _now(amplitude: F8, u: F8) -> Estimate | None:
    """Return the mean amplitude of the last windows; they span three to five swings, as in a reading by eye."""
    values, weights = amplitude[-LAST_WINDOWS:], u[-LAST_WINDOWS:] ** -2.0
    if values.size < 2 or not np.isfinite(weights).all():
        return None
    return Estimate(float(np.average(values, weights=weights)), float(weights.sum() ** -0.5), "m")


def _latest_fit(motion: Oscillation, end: float) -> dict[str, Any]:
    """Return the sinusoid of the last window: rest + amplitude decay(t) cos(omega (t - moment) + phase).

    ``decay`` is the amplitude of the damping law divided by its amplitude at ``moment``, in even steps of time.
    """
    windows, damping = motion.demodulated, motion.damping
    after = np.linspace(-FIT_BEFORE_S, FIT_AFTER_S, FIT_POINTS)
    curve = damping.best.amplitude(np.maximum(windows.t[-1] + after - damping.t0, 0.0))
    now = float(damping.best.amplitude(windows.t[-1:] - damping.t0)[0])
    decay = np.clip(np.nan_to_num(curve / now), 0.0, None) if now > 0.0 else np.ones(after.size)
    return {
        "decay": {"from": -FIT_BEFORE_S, "step": float(after[1] - after[0]), "value": drawn(decay)},
        "moment": float(windows.t[-1]),
        "amplitude": float(windows.amplitude[-1]),
        "phase": float(windows.phase[-1]),
        "rest": float(windows.offset[-1]),
        "omega": windows.angular_frequency,
        "end": end,
    }


def drawn(values: NDArray[np.floating[Any]]) -> list[float]:
    """Round the numbers (n,) of a curve to seven digits: finer than any screen, and half the size in a message."""
    with np.errstate(divide="ignore", invalid="ignore"):
        digits = np.clip(np.nan_to_num(6.0 - np.floor(np.log10(np.abs(values))), posinf=0.0, neginf=0.0), -15, 290)
    factor = 10.0**digits
    drawn: list[float] = (np.round(values * factor) / factor).tolist()
    return drawn


def _in_message(estimate: Estimate) -> dict[str, Any]:
    u = estimate.u if math.isfinite(estimate.u) else None
    return {"value": estimate.value, "u": u, "unit": estimate.unit, "text": str(estimate)}


def spectrum(track: Track) -> dict[str, Any]:
    """Return the spectrum of the latest samples under a Hann window; missing samples are replaced by the mean.

    Returns
    -------
    dict
        Frequencies ``f`` in Hz and amplitudes ``value`` in the unit of the samples, fewer than 2048 each, and
        ``peaks``, the highest five at most. Each peak has ``f``, ``value`` and ``step``, the spacing of neighbouring
        frequencies in Hz.

    Notes
    -----
    A peak exceeds the level that the maximum of n frequencies of pure noise exceeds with a probability of 0.001. The
    amplitudes of noise follow a Rayleigh distribution, whose quantiles are multiples of its median m. Here m is the
    median over the neighbouring frequencies, because a swing and outliers raise the noise around them:
    :math:`A(\\alpha) = m \\sqrt{\\log_2(n/\\alpha)}`. A peak also exceeds the lowest point between it and any higher
    peak by a factor of at least two.
    """
    # Samples before the release are omitted: they contain no oscillation, and the step at the release would add lines
    # to the spectrum.
    y = track.y if track.trigger_s is None else track.y[track.t >= track.trigger_s]
    y = y[-SPECTRUM_SAMPLES:]
    seen = np.isfinite(y)
    if y.size < 64 or not seen.any():
        return {"f": [], "value": [], "peaks": []}
    centred = np.where(seen, y - y[seen].mean(), 0.0)
    window = np.hanning(y.size)
    amplitude = 2.0 * np.abs(np.fft.rfft(centred * window)) / window.sum()
    f = np.fft.rfftfreq(y.size, 1.0 / track.rate_hz)
    group = max(1, f.size // SPECTRUM_POINTS)
    whole = f.size // group * group
    return {
        "f": drawn(f[:whole].reshape(-1, group)[:, 0]),
        "value": drawn(amplitude[:whole].reshape(-1, group).max(axis=1)),  # the maximum keeps the height of a line
        "peaks": _peaks(f, amplitude),
    }


def _peaks(f: NDArray[np.floating[Any]], amplitude: NDArray[np.floating[Any]]) -> list[dict[str, float]]:
    from scipy.ndimage import median_filter
    from scipy.signal import find_peaks

    inner = amplitude[MAIN_LOBE:]  # the lowest frequencies may contain a drift
    noise = median_filter(inner, NEIGHBOURS) * math.sqrt(math.log2(inner.size / PEAK_FALSE_ALARM))
    floor = float(inner.max()) * 1e-12  # for a spectrum without noise
    if not floor > 0.0:
        return []
    decibels, level = (20.0 * np.log10(np.maximum(each, floor)) for each in (inner, noise))
    at = find_peaks(decibels, height=level, distance=MAIN_LOBE, prominence=6.0)[0]
    step = float(f[1] - f[0])
    peaks = []
    for i in sorted(sorted(map(int, at), key=lambda i: -inner[i])[:MOST_PEAKS]):
        # A parabola through three levels in decibels finds a line under a Hann window to a fiftieth of a frequency
        # step.
        below, top, above = decibels[i - 1 : i + 2]
        shift = 0.5 * float((below - above) / (below - 2.0 * top + above))
        peaks.append({"f": float(f[i + MAIN_LOBE]) + shift * step, "value": float(inner[i]), "step": step})
    return peaks


class Watcher:
    """Analyses the first sensor's samples in a thread, as often as its share of a core allows.

    While a recording goes on, the fast tier analyses all samples so far and, in between, only the latest seconds for
    the amplitude. A complete run is analysed once, as by ``springmass analyse``.

    Parameters
    ----------
    view : View
    scene : mapping or None
        The bench as the recording states it.
    wanted_u_s : float or None
        Standard uncertainty of the period to reach, s; None means 40 ppm of the period.
    law : str or None
        Stated damping law, as :func:`springmass.runs.analysing.with_law` takes it.

    Attributes
    ----------
    text : str
        The latest message about all samples as JSON, encoded in this thread so that the server does not wait. Its
        ``count`` distinguishes it from the previous message.
    now_text : str
        The latest message about the last seconds as JSON; empty before the first one.
    """

    def __init__(
        self, view: View, scene: Mapping[str, Any] | None, wanted_u_s: float | None, law: str | None = None
    ) -> None:
        self._view = view
        self._scene = Scene.from_mapping(scene or {}, where="the recording's scene")
        self._wanted_u_s, self._law = wanted_u_s, law
        self._closed = False
        self._wake = threading.Event()
        self._complete: Path | None = None
        self._run: AnalysedRun | None = None
        self.text = json_of({"type": "motion", "count": 0, "why": "no analysis so far"})
        self.now_text = ""
        self._thread = threading.Thread(target=self._loop, name="springmass-page-analysis", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Request the end of the thread, which finishes its current analysis first."""
        self._closed = True
        self._wake.set()

    def complete(self, path: Path) -> None:
        """From now on, analyse the run file, as every command does, instead of the samples of its log."""
        if path != self._complete:
            self._complete = path
            self._wake.set()

    @property
    def accuracy(self) -> str:
        """The tier of the analysis."""
        return WHOLE_TIER if self._view.recorded is not None or self._run is not None else LIVE_TIER

    def track(self, low: float = -math.inf, high: float = math.inf) -> Track:
        """Return the first sensor's samples between two times in s."""
        return between(self._view.track() if self._run is None else self._run.loaded.track, low, high)

    def region(self, low: float, high: float) -> str:
        """Return the message about the motion between two times as JSON."""
        found = self._analysed(self.track(low, high))
        return json_of({**found, "type": "region", "from": low, "to": high})

    def moment(self, to: float) -> str:
        """Return as JSON what a live page would have shown at a moment of a complete run, without a forecast."""
        found = motion_of(self.track(high=to), self._scene, law=self._law)
        found.pop("stop", None)
        return json_of({**found, "type": "moment", "to": to})

    def _analysed(self, track: Track) -> dict[str, Any]:
        scene, traps = self._scene, self._view.traps
        if self._run is not None:
            scene, traps = self._run.analysis.scene, self._run.loaded.traps
        return motion_of(track, scene, self._wanted_u_s, traps, law=self._law, accuracy=self.accuracy)

    def _motion(self) -> dict[str, Any]:
        """Analyse all samples, or the run file once it is complete."""
        if self._complete is None:
            return self._analysed(self.track())
        try:
            run = load_and_analyse(self._complete, accuracy=WHOLE_TIER, law=self._law)
        except (AcquisitionError, StorageError, ProgramError, PipelineError) as error:
            return {"type": "motion", "why": str(error), "accuracy": WHOLE_TIER}
        self._run = run
        return _message(lambda: run.analysis, run.loaded.track, WHOLE_TIER, self._wanted_u_s)

    def _now(self, swing_s: float) -> dict[str, Any]:
        """Analyse only the last seconds, and return the message about their amplitude."""
        last_s = float(self._view.series[0].columns()[0][-1])
        recent = self._analysed(self.track(last_s - max(NOW_S, NOW_SWINGS * swing_s)))
        amplitude = recent.get("estimates", {}).get("amplitude_now")
        estimates = {} if amplitude is None else {"amplitude_now": amplitude}
        return {"type": "now", "t_s": last_s, "accuracy": LIVE_TIER, "estimates": estimates}

    def _loop(self) -> None:
        count, seen, is_complete, due_s, swing_s = 0, 0, False, 0.0, 0.0
        wait_s, last_cost_s = 0.0, 0.0
        while not self._closed:
            self._wake.wait(wait_s)
            self._wake.clear()
            wait_s = LEAST_WAIT_S
            samples, complete = len(self._view.series[0]), self._complete is not None
            if self._closed or (samples == seen and complete == is_complete) or is_complete:
                continue
            start_s = time.thread_time()  # CPU time, without waiting for a core that other programs use
            try:
                if complete or time.monotonic() >= due_s:
                    seen, is_complete, count = samples, complete, count + 1
                    message = {**self._motion(), "count": count}
                    swing_s = message.get("estimates", {}).get("period", {}).get("value", 0.0)
                    self.text = json_of(message)
                    cost_s = time.thread_time() - start_s
                    # An analysis that first loads a library takes longer; the next one need not wait for that.
                    due_s = time.monotonic() + min(cost_s, last_cost_s) / SHARE
                    last_cost_s = cost_s
                elif swing_s:
                    self.now_text = json_of(self._now(swing_s))
                    wait_s = max(wait_s, (time.thread_time() - start_s) / NOW_SHARE)
            except Exception as error:  # a defect of the analysis is shown, and the samples are still displayed
                self.text = json_of({"type": "motion", "count": count, "why": f"{type(error).__name__}: {error}"})
