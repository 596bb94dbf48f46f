"""What stands at the head of a page: when and at which bench a run was recorded, and what was noted meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from acquisition.errors import visible
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from springmass.report.tables import pretty

__all__ = ["Note", "bench_words", "calibration_of", "date_words", "notes_of"]

_ON_THE_BENCH = (
    ("bob", "bob_mass_kg"),
    ("spring", "spring_mass_kg"),
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


@dataclass(frozen=True, slots=True)
class Note:
    """Something that was noted while a run was recorded.

    Parameters
    ----------
    t_s : float
        Since the first sample, s.
    text : str
        In words.
    kind : str
        "mark", or an event's: "trigger", "lost", ...
    """

    t_s: float
    text: str
    kind: str


def notes_of(recorded: Mapping[str, Any]) -> tuple[Note, ...]:
    """Return marks and events of a recording in the order of their times.

    Parameters
    ----------
    recorded : mapping
        What a run file says of its origin.
    """
    marks = [Note(mark["t_s"], visible(str(mark["text"])), "mark") for mark in recorded.get("marks", ())]
    events = [
        Note(event["t_s"], _facts(event.get("facts", {})), str(event["kind"])) for event in recorded.get("events", ())
    ]
    return tuple(sorted([*marks, *events], key=lambda note: note.t_s))


def _facts(facts: Mapping[str, Any]) -> str:
    told = (
        f"{name.replace('_', ' ')} {value:g}" if isinstance(value, float) else f"{name} {value}".replace("_", " ")
        for name, value in facts.items()
        if value is not None
    )
    return visible(", ".join(told))


def calibration_of(recorded: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return what turned echoes into distances: quantity and value in words; empty for an old recording."""
    found = recorded.get("sensor", {}).get("calibration") or {}
    rows = []
    for key, (words, unit) in _CALIBRATED.items():
        if key in found:
            u = found.get(f"u_{key}", 0.0)
            rows.append((words, pretty(Estimate(float(found[key]), float(u), unit))))
    return tuple(rows)


def date_words(recorded: Mapping[str, Any]) -> str:
    """Return when a run was recorded, in UTC where the recording says so; as it stands where it is no such time.

    Examples
    --------
    >>> date_words({"start_time": "2026-11-22T22:30:35.97+00:00"})
    'recorded 2026-11-22 22:30:35 UTC'
    >>> date_words({})
    'date of the recording not known'
    """
    told = recorded.get("start_time")
    if not told:
        return "date of the recording not known"
    try:
        moment = datetime.fromisoformat(str(told))
    except ValueError:
        return f"recorded {visible(str(told))}"
    if moment.tzinfo is None:
        return f"recorded {moment:%Y-%m-%d %H:%M:%S}"
    return f"recorded {moment.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


def bench_words(scene: Scene) -> str:
    """Return the bench in a line: what hung there, in which air."""
    told = [f"{words} {pretty(x)}" for words, name in _ON_THE_BENCH if (x := getattr(scene, name)) is not None]
    if scene.sensor_position is not None:
        told.append(f"sensor {scene.sensor_position}")
    return ", ".join(told) if told else "no scene was given: nothing is known of the masses and the air"
