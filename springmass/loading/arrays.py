"""Recordings from arrays in memory: their units are read or refused, never ignored."""

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import units
from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import FormatIssue, Recording
from acquisition.recordings.tables.headings import heading_of, is_time
from pipeline.errors import TrackError
from pipeline.track import F8, Track
from springmass.loading.inputs import kind_of
from springmass.loading.load import load
from springmass.loading.loaded import Loaded
from springmass.loading.options import LOAD_FIELDS, AnalysisOptions

EXPECTED = "a path, a run, a pair (t, y), or a dataset, frame or mapping with time and distance was expected"
ABOUT = "springmass"
"""The attribute of a dataset with everything but the samples."""


def loaded_of(source: Any, options: AnalysisOptions) -> Loaded:
    """Return arrays in any supported container as a loaded recording; see :func:`springmass.analyse`.

    A dataset of springmass, or one that xarray read from a run file, comes with all that the file states.
    """
    refuse_reading(options, type(source).__name__, ("unit", "time_unit"))
    (t, t_unit), (y, y_unit), flags = _columns(source)
    about: Mapping[str, Any] = getattr(source, "attrs", {})
    measure = _measure(options.unit or y_unit or _unit_of(y) or "m")
    track = Track.from_arrays(
        _seconds(t, options.time_unit or t_unit or _unit_of(t)),
        _numbers(y, "values") * 10.0**measure.power * measure.factor,
        flags=flags,
        **{name: about[name] for name in ("rate_hz", "sigma_m", "quantum_m", "kind") if name in about},
        unit=measure.si,
    )
    velocity = np.asarray(source["velocity"], np.float64) if ABOUT in about and "velocity" in source else None
    samples = Block(0, track.t, track.y, track.flags, None, velocity, measure.quantity, track.unit)
    if (recorded := _stated(source, about, samples)) is not None:
        return recorded
    clock = getattr(t, "attrs", {}).get("clock", track.clock)
    info: Any = (track.kind, "", track.rate_hz, track.sigma_m, track.quantum_m, clock)
    return Loaded(Recording("", "", SourceInfo(*info), "", samples), "memory")


def refuse_reading(options: AnalysisOptions, what: str, allowed: Collection[str] = ()) -> None:
    """Refuse options of reading for what is no file, on which they would have no effect."""
    if others := [name for name in options.given() if name in LOAD_FIELDS and name not in allowed]:
        raise TrackError(f"{', '.join(others)} complete recordings named by a path, got a {what}", "leave that out")


def _stated(source: Any, about: Mapping[str, Any], samples: Block) -> Loaded | None:
    """Return the recording of a dataset that says where its samples come from; None for any other."""
    if ABOUT in about:
        content = json.loads(about[ABOUT])
        recording = Recording(
            content["recorded_format"],
            content["path"],
            SourceInfo(**content["info"]),
            content["channel"],
            samples,
            tuple(FormatIssue(**trap) for trap in content["traps"]),
            content["malformed_rows"],
            title=content["title"],
        )
        return Loaded(recording, *(content[name] for name in ("format", "scene", "provenance", "sha256")))
    path = Path(getattr(source, "encoding", {}).get("source", ""))
    if path.is_file() and kind_of(path) == "run":
        loaded = load(path)
        # Samples at the same times have the same velocities and times of arrival.
        if np.array_equal(samples.t, loaded.samples.t, equal_nan=True):
            samples = replace(samples, velocity=loaded.samples.velocity, host_ns=loaded.samples.host_ns)
        return replace(loaded, recording=replace(loaded.recording, samples=samples))
    return None


def about_json(loaded: Loaded, scene: Mapping[str, Any]) -> str:
    """Return everything about a recording but its samples and the bytes of its originals."""
    recording = loaded.recording
    about = {
        "format": loaded.format,
        "channel": recording.channel,
        "title": recording.title,
        "malformed_rows": recording.malformed_rows,
        "provenance": loaded.provenance,
        "recorded_format": recording.format,
        "sha256": loaded.sha256,
        "path": loaded.source,
        "info": asdict(recording.info),
        "traps": [asdict(trap) for trap in recording.traps],
        "scene": dict(scene),
    }
    return json.dumps(about)


def _columns(source: Any) -> tuple[tuple[Any, str], tuple[Any, str], Any]:
    """Return the times and the values of a container, each with the unit that its heading states, and the flags."""
    if hasattr(source, "keys") and "distance" in source:
        t = source["time"] if "time" in source else _index_of(source)
        # The "in" of a frame and of a dataset is that of their columns.
        flags = source["quality"] if "quality" in source else None  # noqa: SIM401
        if t is not None:
            return (t, ""), (source["distance"], ""), flags
    elif hasattr(source, "columns"):
        return *_by_headings(source), None
    elif getattr(source, "ndim", None) == 1 and (along := _along(source)) is not None:
        return (along, ""), (source, ""), None
    elif getattr(source, "ndim", None) == 1 and hasattr(source, "index"):
        return (_index_of(source), ""), (source, ""), None
    elif isinstance(source, list | tuple) and len(source) == 2:
        return (source[0], ""), (source[1], ""), None
    if coords := ", ".join(map(str, getattr(source, "coords", ()))):
        raise TrackError(
            f"its times were expected as a coordinate named time, got {coords}", "rename the one with times"
        )
    raise TrackError(f"{EXPECTED}, got {type(source).__name__}")


def _along(source: Any) -> Any:
    """Return the coordinate named time of a data array, or the only one along its dimension; else None."""
    along = {str(name): each for name, each in getattr(source, "coords", {}).items() if each.dims == source.dims}
    return along.get("time", next(iter(along.values())) if len(along) == 1 else None)


def _by_headings(frame: Any) -> tuple[tuple[Any, str], tuple[Any, str]]:
    """Return the time and the only other column of a frame, whose headings are as in a CSV file."""
    headings = [(name, *heading_of(str(name))) for name in frame.columns]
    times = [(name, unit) for name, words, unit in headings if is_time(words)]
    others = [(name, unit) for name, words, unit in headings if not is_time(words)]
    if len(times) != 1 or len(others) != 1:
        named = ", ".join(repr(name) for name, *_ in headings)
        raise TrackError(f"one column of times and one of values were expected, got {named}", "choose two of them")
    return (frame[times[0][0]], times[0][1]), (frame[others[0][0]], others[0][1])


def _index_of(source: Any) -> Any:
    """Return the index of a frame or series, None without one; refuse one that only counts rows."""
    if not hasattr(source, "index"):
        return None
    import pandas as pd

    if isinstance(source.index, pd.RangeIndex):
        raise TrackError("its index counts rows and is no time", 'give times as its index, or as a column "time"')
    return source.index


def _unit_of(values: Any) -> str:
    """Return the unit that an array states: a quantity of pint, or the attribute of a data array."""
    if hasattr(values, "magnitude") and hasattr(values, "units"):
        return str(values.units)
    unit = str(getattr(values, "attrs", {}).get("units", ""))
    return unit.partition(" since ")[0]  # as in "milliseconds since 2026-11-26"


def _measure(unit: str) -> units.Measure:
    measure = units.measure_of(unit.replace("**", "^").replace(" ", ""))
    if measure is None:
        raise TrackError(f"unknown unit {unit!r} of the values", f"give unit=, one of {', '.join(units.MEASURES)}")
    return measure


def _numbers(values: Any, what: str) -> F8:
    """Return numbers as an array; masked values are missing, and complex ones are refused."""
    plain = np.ma.asarray(getattr(values, "magnitude", values))
    if plain.dtype.kind == "c":
        raise TrackError(f"{what} are complex numbers", "give their real part, or their absolute value")
    try:
        return np.asarray(np.ma.filled(plain.astype(np.float64), np.nan))
    except (TypeError, ValueError):
        raise TrackError(f"{what} are no numbers, but {plain.dtype}", "convert them first") from None


def _seconds(t: Any, unit: str) -> F8:
    """Return times in s; dates become the time since the first date."""
    zoned = getattr(t, "dt", t)  # a column of dates has its time zone there
    if getattr(zoned, "tz", None) is not None:
        t = zoned.tz_convert(None)
    times = np.asarray(getattr(t, "magnitude", t))
    if times.dtype.kind == "O" and times.size and hasattr(times.flat[0], "timestamp"):
        stamps = np.array([each.timestamp() for each in times.flat], np.float64)
        return np.asarray(stamps - stamps[0])
    if times.dtype.kind == "M":
        times = times - times[0]
    if times.dtype.kind == "m":
        return np.asarray(times / np.timedelta64(1, "s"), np.float64)
    measure = units.time_unit(unit or "s")
    if measure is None:
        raise TrackError(f"unknown unit {unit!r} of the times", f"give time_unit=, one of {', '.join(units.TIMES)}")
    return np.asarray(_numbers(t, "times") * (10.0**measure.power * measure.factor))
