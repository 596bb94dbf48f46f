"""The head of a page: date and bench of the recording, and notes that were made during it."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from acquisition.errors import visible
from acquisition.events import Noted, StoredEvent, Triggered, Zeroed, recorded_events
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from springmass.charts.chart import ChartNote
from springmass.typeset import pretty

_ON_THE_BENCH = (
    ("bob", "bob_mass_kg"),
    ("spring", "spring_mass_kg"),
    ("pendulum", "pendulum_length_m"),
    ("disc", "disc_diameter_m"),
    ("air", "air_temperature_c"),
    ("pressure", "air_pressure_pa"),
    ("relative humidity", "air_relative_humidity"),
)
_CALIBRATED = {
    "offset_m": ("offset", "m"),
    "scale": ("scale", ""),
    "speed_of_sound_m_per_s": ("speed of sound", "m/s"),
}


IN_WORDS = (Zeroed, Triggered, Noted)
"""Events whose words name them."""


def notes_of(recorded: Mapping[str, Any]) -> tuple[ChartNote, ...]:
    """Return marks and events of a recording in the order of their times."""
    marks = [ChartNote(mark["t_s"], visible(str(mark["text"])), "mark") for mark in recorded.get("marks", ())]
    events = [ChartNote(t_s, visible(event_words(event)), event.kind) for t_s, event in recorded_events(recorded)]
    return tuple(sorted([*marks, *events], key=lambda note: note.t_s))


def named_event(event: StoredEvent) -> str:
    """Return an event in words that name it."""
    words = event_words(event)
    return words if isinstance(event.typed, IN_WORDS) else ": ".join(filter(None, (event.kind, words)))


def event_words(event: StoredEvent) -> str:
    """Return an event in words; of most kinds the names and values of its facts."""
    match event.typed:  # a log by another program may state other facts
        case Zeroed(rest_m=float() as rest_m, noise_m=float() as noise_m):
            return f"Zero {1e3 * rest_m:.1f} mm, noise {1e3 * noise_m:.2f} mm"
        case Triggered(threshold_m=float() as threshold_m, keep_s=float() as keep_s):
            return f"Trigger at {1e3 * threshold_m:.0f} mm, {keep_s:g} s kept"
        case Noted(text=str() as text):
            return f"Note: {text}"
    facts = {name.replace("_", " "): value for name, value in event.facts.items() if value is not None}
    return ", ".join(f"{name} {x:.4g}" if isinstance(x, float) else f"{name} {x}" for name, x in facts.items())


def calibration_of(recorded: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return the calibration from echoes to distances as (quantity, value) in words; empty for an old recording."""
    calibration = recorded.get("sensor", {}).get("calibration") or {}
    rows = []
    for key, (words, unit) in _CALIBRATED.items():
        if key in calibration:
            u = calibration.get(f"u_{key}", 0.0)
            rows.append((words, pretty(Estimate(float(calibration[key]), float(u), unit))))
    return tuple(rows)


def date_words(recorded: Mapping[str, Any]) -> str:
    """Return in words when a run was recorded; empty if nothing but its title may say so.

    >>> date_words({"start_time": "2026-11-22T22:30:35.97+00:00"})
    'Recorded 2026-11-22 22:30:35 UTC.'
    """
    start = recorded.get("start_time")
    if not start:
        return ""
    try:
        moment = datetime.fromisoformat(str(start))
    except ValueError:
        return f"Recorded {visible(str(start))}."
    zone = "" if moment.tzinfo is None else " UTC"
    return f"Recorded {moment.astimezone(UTC) if zone else moment:%Y-%m-%d %H:%M:%S}{zone}."


def bench_words(scene: Scene) -> str:
    """Describe the bench in one line: bob, spring, disc, air and sensor."""
    parts = [f"{words} {pretty(x)}" for words, name in _ON_THE_BENCH if (x := getattr(scene, name)) is not None]
    if scene.sensor_position is not None:
        parts.append(f"sensor {scene.sensor_position}")
    return ", ".join(parts) if parts else "not stated; the spring constant needs the mass"
