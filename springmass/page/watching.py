"""The motion of what has been recorded so far, worked out again and again beside the page, never in its way."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.accuracy import params_for
from pipeline.analyse import Analysis, Oscillation, analyse
from pipeline.bench.instrument import Instrument
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from pipeline.numerics.estimate import Estimate
from pipeline.track import F8, Track
from springmass.page.stopping import ALPHA, more_seconds, widening
from springmass.page.telling import Need, seconds_to_tell
from springmass.page.view import View, json_of
from springmass.report.advice import advice_on

__all__ = ["Watcher", "drawn", "motion_of"]

SHARE = 0.05
"""Of a core that the analysis takes at most: it waits twenty times as long as it worked."""
LEAST_WAIT_S = 1.0
NAMES = ("period", "spring_constant", "damping_rate", "noise", "offset", "quality_factor")
CURVE_POINTS = 200
FIT_BEFORE_S, FIT_AFTER_S, FIT_POINTS = 40.0, 60.0, 101
"""The latest fit is drawn so long before its last window and after it."""
LAST_WINDOWS = 4
U_CLOCK_REACH = 2.0
"""So many u of a fixed, unknown rate of the clock: nobody stops on it."""
WANTED = 4e-5
"""Of the period: a little more than a crystal's 50 ppm leave, so that it can be reached."""
MOST_POINTS = 600
"""Amplitudes of a long record are told so many."""
SPECTRUM_SAMPLES = 1 << 13
SPECTRUM_POINTS = 1024


def motion_of(track: Track, scene: Scene, wanted_u_s: float | None = None) -> dict[str, Any]:
    """Analyse a record and return the message on its motion.

    Parameters
    ----------
    track : Track
    scene : Scene
    wanted_u_s : float, optional
        Standard uncertainty of the period that is aimed at, s; left out, 40 ppm of it.
    """
    message: dict[str, Any] = {"type": "motion", "why": "", "spectrum": spectrum(track)}
    try:
        analysis = analyse(track, scene, params_for("fast"))
    except PipelineError as error:
        return {**message, "why": str(error)}
    message["findings"] = [
        {"code": f.code, "severity": f.severity, "message": f.message, "advice": advice_on(f.code, analysis)}
        for f in analysis.findings
        if f.severity != "info"
    ]
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return {**message, "why": motion.why, "estimates": _estimates(analysis)}
    return {**message, **_oscillation(analysis, motion, wanted_u_s)}


def _estimates(analysis: Analysis) -> dict[str, dict[str, Any]]:
    found = {name: analysis.estimates[name] for name in NAMES if name in analysis.estimates}
    return {name: _told(each) for name, each in {**found, **_sampling(analysis.track)}.items()}


def _sampling(track: Track) -> dict[str, Estimate]:
    """Return the rate, Hz, and the share of samples that are missing, %.

    The rate's u is what the clock may be off and what the times scatter by; a share's is that of its posterior by
    Jeffreys' prior, for none missing of a few is no proof that none will be.
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
    told = kept[:: -(-kept.size // MOST_POINTS)]
    start, end = damping.t0, float(np.nanmax(analysis.track.t))
    times = np.linspace(start, end, CURVE_POINTS)
    estimates = _estimates(analysis)
    if (now := _now(windows.amplitude[kept], damping.scatter.u[kept])) is not None:
        estimates["amplitude_now"] = _told(now)
    period, frequency = analysis.estimates["period"], motion.phase.angular_frequency
    wanted_u_s = WANTED * period.value if aim_s is None else aim_s
    # What the samples leave open shrinks with the recording; what the sensor's clock may be off does not.
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
            "t": drawn(windows.t[told]),
            "value": drawn(windows.amplitude[told]),
            "u": drawn(damping.scatter.u[told]),
        },
        "laws": [
            {"name": name, "t": drawn(times), "value": drawn(fit.amplitude(times - damping.t0))}
            for name, fit in damping.considered.items()
        ],
        "law": damping.selected,
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
            "laws": _need(seconds_to_tell(damping, end)),
        },
    }


def _need(need: Need | None) -> dict[str, Any] | None:
    if need is None:
        return None
    return {name: None if each == math.inf else each for name, each in asdict(need).items()}


def _now(amplitude: F8, u: F8) -> Estimate | None:
    """Return the mean of the last windows' amplitudes: three to five swings, as people read it off."""
    values, weights = amplitude[-LAST_WINDOWS:], u[-LAST_WINDOWS:] ** -2.0
    if values.size < 2 or not np.isfinite(weights).all():
        return None
    return Estimate(float(np.average(values, weights=weights)), float(weights.sum() ** -0.5), "m")


def _latest_fit(motion: Oscillation, end: float) -> dict[str, Any]:
    """Return the last window's sine, position = rest + amplitude decay(t) cos(omega (t - moment) + phase).

    ``decay`` is the damping law's amplitude by that of the moment, in even steps of time from the moment.
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
    """Return numbers (n,) of a curve to seven digits: finer than any screen, and half as long to write and to read."""
    with np.errstate(divide="ignore", invalid="ignore"):
        digits = np.clip(np.nan_to_num(6.0 - np.floor(np.log10(np.abs(values))), posinf=0.0, neginf=0.0), -15, 290)
    factor = 10.0**digits
    drawn: list[float] = (np.round(values * factor) / factor).tolist()
    return drawn


def _told(estimate: Estimate) -> dict[str, Any]:
    u = estimate.u if math.isfinite(estimate.u) else None
    return {"value": estimate.value, "u": u, "unit": estimate.unit, "text": str(estimate)}


def spectrum(track: Track) -> dict[str, list[float]]:
    """Return frequencies in Hz and amplitudes of the latest samples, by a Hann window; the mean for missing ones."""
    y = track.y[-SPECTRUM_SAMPLES:]
    if y.size < 64:
        return {"f": [], "value": []}
    seen = np.isfinite(y)
    if not seen.any():
        return {"f": [], "value": []}
    rest = np.where(seen, y - y[seen].mean(), 0.0)
    window = np.hanning(y.size)
    amplitude = 2.0 * np.abs(np.fft.rfft(rest * window)) / window.sum()
    f = np.fft.rfftfreq(y.size, 1.0 / track.rate_hz)
    group = max(1, f.size // SPECTRUM_POINTS)
    whole = f.size // group * group
    return {
        "f": drawn(f[:whole].reshape(-1, group)[:, 0]),
        "value": drawn(amplitude[:whole].reshape(-1, group).max(axis=1)),  # a line stays as high as it is
    }


class Watcher:
    """Analyses the first sensor's samples on a thread of its own, as often as its share of a core allows.

    Parameters
    ----------
    view : View
    scene : mapping or None
        What the recording says of its bench.
    wanted_u_s : float or None
        Of the period, s; None: 40 ppm of it.

    Attributes
    ----------
    text : str
        The latest message as JSON, made here and not where others wait; its ``count`` tells one from the one before.
    """

    def __init__(self, view: View, scene: Mapping[str, Any] | None, wanted_u_s: float | None) -> None:
        self._view = view
        self._scene = Scene.from_mapping(scene or {}, where="the recording's scene")
        self._wanted_u_s = wanted_u_s
        self._stop = threading.Event()
        self.text = json_of({"type": "motion", "count": 0, "why": "no samples so far"})
        self._thread = threading.Thread(target=self._run, name="springmass-page-analysis", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ask for no more; the thread ends with its analysis."""
        self._stop.set()

    def track(self, low: float = -math.inf, high: float = math.inf) -> Track:
        """Return the first sensor's samples between two times."""
        t, y, flags = self._view.series[0].columns()
        keep = (t >= low) & (t <= high)
        view = self._view
        return Track(
            t[keep],
            y[keep],
            flags[keep],
            view.rate_hz,
            clock=view.clock,
            quantity=view.quantity,
            unit=view.unit,
        )

    def region(self, low: float, high: float) -> str:
        """Return the message on the motion between two times, as JSON."""
        found = motion_of(self.track(low, high), self._scene, self._wanted_u_s)
        return json_of({**found, "type": "region", "from": low, "to": high})

    def _run(self) -> None:
        count, seen, wait_s = 0, 0, 0.0
        while not self._stop.wait(wait_s):
            wait_s = LEAST_WAIT_S
            if len(self._view.series[0]) == seen:
                continue
            start_s = time.thread_time()  # of work, not of waiting for a core that others hold
            seen, count = len(self._view.series[0]), count + 1
            try:
                message = {**motion_of(self.track(), self._scene, self._wanted_u_s), "count": count}
            except Exception as error:  # a defect of the analysis is shown, and the samples go on
                message = {"type": "motion", "count": count, "why": f"{type(error).__name__}: {error}"}
            self.text = json_of(message)
            if count > 1:  # the first one loads what it needs
                wait_s = max(LEAST_WAIT_S, (time.thread_time() - start_s) / SHARE)
