"""Repeated analysis of the samples so far, in a thread, and when to stop; the server never waits for it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.recordings.recording import FormatIssue
from pipeline.analyse import Analysis, Oscillation
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from pipeline.track import F8, Track
from springmass.charts.chart import to_json
from springmass.charts.run import CHARTS
from springmass.errors import Error
from springmass.loading.options import Accuracy, AnalysisOptions
from springmass.loading.track import between
from springmass.page.view import View, json_of
from springmass.result.run_json import picked
from springmass.runs.run import Run, analyse_track

LIVE_TIER: Accuracy = "fast"
WHOLE_TIER: Accuracy = "standard"
"""Tiers of the analysis during a recording, and of a complete run; the latter is the default of every command."""
ANALYSIS_SHARE = 0.025
"""Maximum fraction of a core for analyses of all samples, and as much for those of the last seconds; together 5 %."""
NOW_S, NOW_SWINGS = 10.0, 8.0
"""Duration of the samples for the current amplitude, in seconds and in swings; the longer duration counts."""
LEAST_WAIT_S = 1.0
NAMES = ("period", "spring_constant", "damping_rate", "noise", "offset", "quality_factor")
SHOWN_CHARTS = ("amplitude", "spectrum")
FIT_BEFORE_S, FIT_AFTER_S, FIT_POINTS = 40.0, 60.0, 101
"""Time range of the latest fit before and after its last window in s, and its number of points."""
LAST_WINDOWS = 4
LONGEST_FORECAST = 50.0
"""The longest forecast of when to stop, in multiples of the time recorded so far."""
WANTED = 4e-5
"""Wanted u relative to the period: a little above the u of a 50 ppm crystal, so that it can be reached."""


def motion_of(
    track: Track,
    scene: Scene,
    wanted_u_s: float | None = None,
    traps: Sequence[FormatIssue] = (),
    *,
    law: str | None = None,
    accuracy: Accuracy = LIVE_TIER,
    charts: bool = False,
) -> dict[str, Any]:
    """Analyse samples and return the message about their motion; None wants u(T) to reach 40 ppm of the period."""
    try:
        analysis = analyse_track(track, scene, AnalysisOptions(accuracy=accuracy, law=law), traps)
    except PipelineError as error:
        return {"type": "motion", "why": str(error), "accuracy": accuracy, "t_s": _end(track)}
    return _message(analysis, accuracy, wanted_u_s, charts=charts)


def _end(track: Track) -> float | None:
    return float(np.nanmax(track.t)) if np.isfinite(track.t).any() else None


def _message(analysis: Analysis, accuracy: str, wanted_u_s: float | None, *, charts: bool) -> dict[str, Any]:
    motion, unit = analysis.motion, analysis.track.unit
    graver = [f for f in analysis.findings if f.severity != "info"]
    message: dict[str, Any] = {
        "type": "motion",
        "why": "",
        "accuracy": accuracy,
        "t_s": _end(analysis.track),
        "findings": [picked(f, ("code", "severity", "message", "advice")) for f in graver],
    }
    shown = {name: analysis.estimates[name] for name in NAMES if name in analysis.estimates}
    if isinstance(motion, Oscillation):
        shown |= _amplitude_now(motion, unit)
        message |= {
            "law": motion.damping.selected,
            "stated_law": motion.damping.stated,
            "rest_m": analysis.estimates["offset"].value,
            "omega": analysis.estimates["angular_frequency"].value,
            "fit": _latest_fit(motion),
            "stop": _stop(analysis, motion, wanted_u_s),
        }
        if charts:
            made = {name: CHARTS[name](analysis) for name in SHOWN_CHARTS}
            message["charts"] = {name: to_json(chart) for name, chart in made.items() if chart is not None}
    else:
        message["why"] = motion.why
    estimates = {name: {"value": x.value, "u": x.u, "unit": x.unit, "text": str(x)} for name, x in shown.items()}
    return {**message, "estimates": estimates}


def _amplitude_now(motion: Oscillation, unit: str) -> dict[str, Estimate]:
    """Return the mean amplitude of the last windows; they span three to five swings, as in a reading by eye."""
    kept = np.flatnonzero(motion.damping.scatter.kept)[-LAST_WINDOWS:]
    weights = motion.damping.scatter.u[kept] ** -2.0
    if kept.size < 2 or not np.isfinite(weights).all():
        return {}
    mean = float(np.average(motion.windows.amplitude[kept], weights=weights))
    return {"amplitude_now": Estimate(mean, float(weights.sum() ** -0.5), unit)}


def _stop(analysis: Analysis, motion: Oscillation, wanted_u_s: float | None) -> dict[str, Any]:
    """Return the uncertainty of the period and how much longer to record for the wanted one.

    The uncertainty from the samples shrinks as the recording grows; that from the sensor's clock does not.
    """
    period, frequency, damping = analysis.estimates["period"], motion.phase.angular_frequency, motion.damping
    wanted_u_s = WANTED * period.value if wanted_u_s is None else wanted_u_s
    u_samples = min(period.value * frequency.u / frequency.value, period.u)
    u_clock = math.sqrt(period.u**2 - u_samples**2)
    more_s = math.inf
    if wanted_u_s > u_clock:
        wanted_u_samples = math.sqrt(wanted_u_s**2 - u_clock**2)
        seconds = float(np.nanmax(analysis.track.t)) - damping.t0
        more_s = more_seconds(u_samples, wanted_u_samples, seconds, damping.best.amplitude)
    return {
        "wanted_u_s": wanted_u_s,
        "u_s": period.u,
        "u_samples_s": u_samples,
        "u_clock_s": u_clock,
        "more_s": more_s if math.isfinite(more_s) else None,
    }


def more_seconds(u: float, wanted_u: float, seconds: float, amplitude: Callable[[F8], F8]) -> float:
    """Return how much longer to record until a period, or a frequency, has a wanted uncertainty.

    ``seconds`` is the duration so far. ``amplitude`` is the fitted law, which is extrapolated. The information on the
    slope of the phase grows as :math:`J(t) = \\int A^2 (s - \\bar s)^2 ds` where :math:`\\bar s` is the mean time
    weighted by :math:`A^2`; u falls as :math:`J^{-1/2}`. The result is infinite if the swing dies out first, or if the
    recording would have to last more than fifty times as long as now.

    A steady swing: u falls with the power 3/2 of the time.

    >>> round(more_seconds(8.0, 1.0, 10.0, lambda t: np.ones_like(t)))
    30
    """
    if u <= wanted_u:
        return 0.0
    times = seconds * np.geomspace(1e-3, LONGEST_FORECAST, 4000)
    steps = np.diff(times, prepend=0.0)
    weight = amplitude(times) ** 2 * steps
    w, wt, wtt = np.cumsum(weight), np.cumsum(weight * times), np.cumsum(weight * times**2)
    information = wtt - wt**2 / w
    now = float(np.interp(seconds, times, information))
    reached = np.flatnonzero(information >= now * (u / wanted_u) ** 2)
    return float(times[reached[0]] - seconds) if reached.size else math.inf


def _latest_fit(motion: Oscillation) -> dict[str, Any]:
    """Return the sinusoid of the last window: rest + amplitude decay(t) cos(omega (t - moment) + phase).

    ``decay`` is the amplitude of the damping law divided by its amplitude at ``moment``, in even steps of time.
    """
    windows, damping = motion.windows, motion.damping
    after = np.linspace(-FIT_BEFORE_S, FIT_AFTER_S, FIT_POINTS)
    curve = damping.best.amplitude(np.maximum(windows.t[-1] + after - damping.t0, 0.0))
    now = float(damping.best.amplitude(windows.t[-1:] - damping.t0)[0])
    decay: F8 = np.clip(np.nan_to_num(curve / now), 0.0, None) if now > 0.0 else np.ones(after.size)
    return {
        "decay": {"from": -FIT_BEFORE_S, "step": float(after[1] - after[0]), "value": np.round(decay, 6).tolist()},
        "start": damping.t0,
        "moment": float(windows.t[-1]),
        "amplitude": float(windows.amplitude[-1]),
        "phase": float(windows.phase[-1]),
        "rest": float(windows.offset[-1]),
        "omega": windows.angular_frequency,
    }


class Watcher:
    """Analyses the first sensor's samples in a thread, as often as its share of a core allows.

    While a recording goes on, the fast tier analyses all samples so far and, in between, only the latest seconds for
    the amplitude. A complete run is analysed once, as by ``springmass analyse``. ``text`` is the latest message about
    all samples; ``update`` is the same with a newer amplitude and without charts, or empty. Both are JSON encoded in
    this thread.
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
        self._run: Run | None = None
        self.text = json_of({"type": "motion", "count": 0, "why": "no analysis so far"})
        self.update = ""
        threading.Thread(target=self._loop, name="springmass-page-analysis", daemon=True).start()

    def close(self) -> None:
        """Request the end of the thread, which finishes its current analysis first."""
        self._closed = True
        self._wake.set()

    def complete(self, path: Path) -> None:
        """From now on, analyse the run file, as every command does, instead of the samples of its log."""
        if path != self._complete:
            self._complete = path
            self._wake.set()

    def region(self, low: float, high: float) -> str:
        """Return the message about the motion between two times as JSON."""
        return json_of({**self._between(low, high), "type": "region", "from": low, "to": high})

    def _between(self, low: float = -math.inf, high: float = math.inf, *, charts: bool = False) -> dict[str, Any]:
        track, scene, traps = self._view.track(), self._scene, self._view.traps
        if self._run is not None:
            track, scene, traps = self._run.loaded.track, self._run.scene, self._run.loaded.traps
        accuracy = LIVE_TIER if self._run is None and self._view.recorded is None else WHOLE_TIER
        track = between(track, low, high)
        return motion_of(track, scene, self._wanted_u_s, traps, law=self._law, accuracy=accuracy, charts=charts)

    def _motion(self) -> dict[str, Any]:
        """Analyse all samples, or the run file once it is complete."""
        if self._complete is None:
            return self._between(charts=True)
        try:
            run = Run.of(self._complete, how=AnalysisOptions(accuracy=WHOLE_TIER, law=self._law))
        except Error as error:
            return {"type": "motion", "why": str(error), "accuracy": WHOLE_TIER}
        self._run = run
        return _message(run.analysis, WHOLE_TIER, self._wanted_u_s, charts=True)

    def _updated(self, message: dict[str, Any], swing_s: float) -> dict[str, Any]:
        """Analyse only the last seconds, and return a message with their amplitude and without its charts."""
        last_s = float(self._view.series[0].block().t[-1])
        estimates = self._between(last_s - max(NOW_S, NOW_SWINGS * swing_s)).get("estimates", {})
        newer = {name: {**x, "t_s": last_s} for name, x in estimates.items() if name == "amplitude_now"}
        fields = {name: x for name, x in message.items() if name != "charts"}
        return {**fields, "estimates": {**message["estimates"], **newer}}

    def _loop(self) -> None:
        count, seen, is_complete, due_s, swing_s = 0, 0, False, 0.0, 0.0
        wait_s, last_cost_s = 0.0, 0.0
        message: dict[str, Any] = {}
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
                    self.update, self.text = "", json_of(message)
                    cost_s = time.thread_time() - start_s
                    # An analysis that first loads a library takes longer; the next one need not wait for that.
                    due_s = time.monotonic() + min(cost_s, last_cost_s) / ANALYSIS_SHARE
                    last_cost_s = cost_s
                elif swing_s:
                    self.update = json_of(self._updated(message, swing_s))
                    wait_s = max(wait_s, (time.thread_time() - start_s) / ANALYSIS_SHARE)
            except Exception as error:  # a defect of the analysis is shown, and the samples are still displayed
                self.text = json_of({"type": "motion", "count": count, "why": f"{type(error).__name__}: {error}"})
