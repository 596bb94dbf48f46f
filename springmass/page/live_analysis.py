"""Repeated analysis of the samples so far, in a thread, and when to stop; the server never waits for it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.estimate import Estimate
from pipeline.track import F8
from springmass.charts.chart import to_json
from springmass.charts.run import CHARTS
from springmass.errors import Error
from springmass.loading.options import AnalysisOptions
from springmass.page.view import View, json_of
from springmass.result.run_json import picked
from springmass.runs.rolling import NotYet, Rolling, analysed, part_of
from springmass.runs.run import Run

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


def motion_message(found: Run | NotYet, wanted_u_s: float | None = None, *, charts: bool = False) -> dict[str, Any]:
    """Return the message about the motion; None wants u(T) to reach 40 ppm of the period."""
    if isinstance(found, NotYet):
        return {"type": "motion", "why": found.why}
    analysis = found.analysis
    motion, times = analysis.oscillation, analysis.track.t
    graver = [f for f in analysis.findings if f.severity != "info"]
    message: dict[str, Any] = {
        "type": "motion",
        "why": "" if motion is not None else analysis.why,
        "accuracy": found.how.accuracy,
        "t_s": float(np.nanmax(times)),
        "findings": [picked(f, ("code", "severity", "message", "advice")) for f in graver],
    }
    shown = {name: analysis.estimates[name] for name in NAMES if name in analysis.estimates}
    if motion is not None:
        shown |= _amplitude_now(motion, analysis.track.unit)
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


def _renewed(message: Mapping[str, Any], found: Run | NotYet) -> dict[str, Any]:
    """Return a message without its charts, with the current amplitude of a newer analysis."""
    recent = motion_message(found)
    newer = recent.get("estimates", {}).get("amplitude_now")
    renewed = {} if newer is None else {"amplitude_now": {**newer, "t_s": recent["t_s"]}}
    fields = {name: x for name, x in message.items() if name != "charts"}
    return {**fields, "estimates": {**message["estimates"], **renewed}}


class Watcher:
    """Analyses the first sensor's samples in a thread, as often as its share of a core allows.

    While a recording goes on, the fast tier analyses all samples so far and, in between, only the latest seconds for
    the amplitude. A complete run is analysed once, as by ``springmass analyse``. ``text`` is the latest message about
    all samples; ``update`` is the same with a newer amplitude and without charts, or empty. Both are JSON encoded in
    this thread.
    """

    def __init__(self, view: View, wanted_u_s: float | None, law: str | None = None) -> None:
        live, samples = AnalysisOptions(accuracy="fast", law=law), view.series[0]
        self._whole = AnalysisOptions(law=law)  # the accuracy of every command
        self._wanted_u_s = wanted_u_s
        self._all = Rolling(lambda block: view.live_run(block, live), share=ANALYSIS_SHARE, samples=samples)
        self._recent = Rolling(lambda block: view.live_run(block, live), share=ANALYSIS_SHARE, samples=samples)
        self._run = None if view.loaded is None else Run(view.loaded, how=self._whole)
        self._closed = False
        self._wake = threading.Event()
        self._complete: Path | None = None
        self.text = json_of({"type": "motion", "count": 0, "why": "no analysis so far"})
        self.update = ""
        threading.Thread(target=self._loop, name="springmass-page-analysis", daemon=True).start()

    def close(self) -> None:
        """Request the end of the thread, which finishes its current analysis first."""
        self._closed = True
        self._wake.set()

    def complete(self, path: Path) -> None:
        """From now on, analyse the run file, as every command does, instead of the samples of its log."""
        self._complete = path
        self._wake.set()

    def region(self, low: float, high: float) -> str:
        """Return the message about the motion between two times as JSON."""
        run = self._all.run() if self._run is None else self._run
        part = analysed(part_of(run, low, high))
        return json_of({**motion_message(part, self._wanted_u_s), "type": "region", "from": low, "to": high})

    def _of_complete(self) -> Run | NotYet:
        """Return the analysed run of the run file once it is complete."""
        try:
            if self._run is None:
                self._run = Run.of(self._complete, how=self._whole)
        except Error as error:
            return NotYet(str(error))
        return analysed(self._run)

    def _loop(self) -> None:
        """Renew the messages until the run is complete."""
        count, message = 0, dict[str, Any]()
        while not self._closed:
            whole = self._run is not None or self._complete is not None
            try:
                if whole or self._all.due():
                    count += 1
                    found = self._of_complete() if whole else self._all.latest()
                    message = {**motion_message(found, self._wanted_u_s, charts=True), "count": count}
                    self.update, self.text = "", json_of(message)
                elif (period := message.get("estimates", {}).get("period")) and self._recent.due():
                    recent = self._recent.latest(max(NOW_S, NOW_SWINGS * period["value"]))
                    self.update = json_of(_renewed(message, recent))
            except Exception as error:  # a defect of the analysis is shown, and the samples are still displayed
                self.text = json_of({"type": "motion", "count": count, "why": f"{type(error).__name__}: {error}"})
            if whole:
                break
            self._wake.wait(LEAST_WAIT_S)
            self._wake.clear()
