"""From a wire log, however torn, to a run file: at the end of every recording, and after a crash.

The bytes go through the very chain that showed them live, so both give the same samples. The log itself travels
inside the run file, bit for bit: nothing that decoding leaves out is lost.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block
from acquisition.recordings.recording import Original, Trap
from storage.errors import RunDamaged, RunExists
from storage.losses import Event, LossCount, Losses, end_of
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run
from storage.wire_log.records import Kind, LogHeader, Record, SensorEntry
from storage.wire_log.scanning import Damage, LogContents, NotALog, read_log
from storage.wire_log.wire_samples import Decoded, decode_log

__all__ = ["RecoverReport", "RecoveredRun", "recover", "run_paths"]


@dataclass(frozen=True, slots=True)
class RecoveredRun:
    """One sensor's run file.

    Parameters
    ----------
    sensor : SensorEntry
    path : Path
        The file, verified.
    samples : int
    faults : mapping of str to int
        What the decoder counted.
    decoding : mapping
        What the chain reports besides: gaps, restarts, the clock's rate error.
    losses : Losses
        What the run lacks.
    """

    sensor: SensorEntry
    path: Path
    samples: int
    faults: Mapping[str, int]
    decoding: Mapping[str, Any]
    losses: Losses

    @property
    def gone(self) -> bool:
        """Whether the sensor was gone at the end."""
        return self.losses.gone_s is not None


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What became of a log.

    Parameters
    ----------
    log : Path
    runs : tuple of RecoveredRun
        One for each sensor.
    damage : Damage
        Of the log.
    marks, events : int
        Kept in the provenance of every run file.
    log_removed : bool
    """

    log: Path
    runs: tuple[RecoveredRun, ...]
    damage: Damage
    marks: int
    events: int
    log_removed: bool

    def describe(self) -> Iterator[str]:
        """Yield lines for people: one a run file, and one about the log."""
        for run in self.runs:
            faults = "".join(f", {count} {name.replace('_', ' ')}" for name, count in run.faults.items() if count)
            yield f"{run.path}: {run.samples} samples from {self.log}{faults}"
            gaps = run.decoding.get("gaps", [])
            if gaps:
                longest = max(gap["length_s"] for gap in gaps)
                lost = sum(gap["lost"] for gap in gaps)
                yield f"{run.path}: {len(gaps)} gaps, {lost} readings lost in them, the longest {longest:.3g} s"
            for trap in run.losses.traps():
                yield f"{run.path}: {trap.code}: {trap.message}"
            clock = run.decoding.get("clock", {})
            if clock.get("kind") == "device" and clock.get("rate_error_ppm") is not None:
                rate = f"{clock['rate_error_ppm']:+.1f} +- {clock['u_rate_error_ppm']:.1f} ppm"
                jitter = f"{clock['host_jitter_s'] * 1e3:.2g} ms"
                yield f"{run.path}: sensor clock {rate} against this host's, jitter {jitter}"
        yield f"{self.log}: {self.damage.describe()}"


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """A log as it was read, once, so that what is decoded and what is kept are the same bytes."""

    original: Original
    contents: LogContents
    header: LogHeader

    def notes(self, kind: Kind) -> list[Record]:
        """Return marks or events."""
        return [record for record in self.contents.notes if record.kind is kind]


def recover(
    log_path: str | os.PathLike[str],
    out_path: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    remove_log: bool = False,
    header: LogHeader | None = None,
    speed_of_sound_m_per_s: float | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> RecoverReport:
    """Build the run file of a log, or one for each sensor where several were recorded.

    Parameters
    ----------
    log_path : str or PathLike
        The log; finished, torn or damaged.
    out_path : str or PathLike, optional
        The run file; left out, the log's name with ``.h5``. With several sensors their channels come before the
        suffix: ``run.0.h5``, ``run.1.h5``.
    overwrite : bool
        Whether run files that stand there may be replaced.
    remove_log : bool
        Whether the log goes once every run file holds it and verifies. Else it stays.
    header : LogHeader, optional
        Stands in where every copy in the log is lost.
    speed_of_sound_m_per_s : float, optional
        Applied to echo times in place of the one that the log notes, m/s.
    provenance : mapping, optional
        Goes into the run file besides what the log says: software, version, ...

    Raises
    ------
    NotALog
        If there is no log, or nothing in it can be read.
    RunExists, WriteFailed
        If a run file stands there already or cannot be written. What stood there stands, and so does the log.
    RunDamaged
        If a run file just written does not read back as it should. The log stands.
    """
    log_path = Path(log_path)
    log = _read(log_path, header)
    other = {} if speed_of_sound_m_per_s is None else {"speed_of_sound_m_per_s": speed_of_sound_m_per_s}
    sensors = _calibrated(log.header.sensors, {}, other)
    paths = run_paths(log_path if out_path is None else Path(out_path), [sensor.channel for sensor in sensors])
    if not overwrite:
        _demand_free(paths)
    decoded = decode_log(log.contents, sensors)
    # Events are known when the log was read; a calibration among them is rare, so only then it is read again.
    if (calibrated := _calibrated(log.header.sensors, _calibrations(log), other)) != sensors:
        decoded = decode_log(log.contents, calibrated)
    losses = _losses(log, decoded)
    runs = [
        _write(path, log, part, lost, provenance or {}, overwrite)
        for path, part, lost in zip(paths, decoded, losses, strict=True)
    ]
    removed = remove_log and _remove(log_path, len(log.original.data))
    marks, events = len(log.notes(Kind.MARK)), len(log.notes(Kind.EVENT))
    return RecoverReport(log_path, tuple(runs), log.contents.damage, marks, events, removed)


def _read(path: Path, stand_in: LogHeader | None) -> _Log:
    contents = read_log(path)
    data = contents.data
    header = contents.header or stand_in
    if header is None:
        if not contents.damage.records:
            raise NotALog(path, f"a wire log was demanded, got {len(data)} bytes without one record", "name another")
        demand = f"the log's header is lost in all its copies ({contents.damage.describe()})"
        raise NotALog(path, demand, "say which sensors were recorded")
    return _Log(Original(path.name, data), contents, header)


def _calibrations(log: _Log) -> dict[int, Mapping[str, Any]]:
    """Return the last calibration that the log notes, by channel."""
    noted = {}
    for event in log.notes(Kind.EVENT):
        content = event.json()
        if content.get("kind") == "calibration":
            noted[event.channel] = content.get("facts", {})
    return noted


def _calibrated(
    sensors: Sequence[SensorEntry], noted: Mapping[int, Mapping[str, Any]], other: Mapping[str, Any]
) -> tuple[SensorEntry, ...]:
    """Return the sensors, each with the calibration noted for its channel, if any, and other numbers in it."""
    return tuple(
        dataclasses.replace(sensor, calibration={**noted.get(sensor.channel, sensor.calibration), **other})
        for sensor in sensors
    )


def run_paths(path: Path, channels: Sequence[int]) -> list[Path]:
    """Return the run files that a log of these channels becomes, named after ``path``."""
    path = path if path.suffix == ".h5" else path.with_suffix(".h5")
    if len(channels) <= 1:
        return [path]
    return [path.with_name(f"{path.stem}.{channel}{path.suffix}") for channel in channels]


def _demand_free(paths: Sequence[Path]) -> None:
    """Look before the work; the writing itself refuses what comes meanwhile."""
    for path in paths:
        if os.path.lexists(path):
            demand = "a new run file was to be written, but a file stands there"
            raise RunExists(path, demand, "choose another name or allow overwriting")


def _losses(log: _Log, decoded: Sequence[Decoded]) -> list[Losses]:
    events: dict[int, list[Event]] = {part.sensor.channel: [] for part in decoded}
    for event in log.notes(Kind.EVENT):
        events.setdefault(event.channel, []).append((event.mono_ns, event.json()))
    counts = [LossCount(part.chain.timebase.rate_hz) for part in decoded]
    for count, part in zip(counts, decoded, strict=True):
        count.push(part.samples)
    start_ns = log.header.mono_ns
    everything = [event for each in events.values() for event in each]
    end_ns = end_of(everything, [count.last_ns for count in counts], start_ns)
    return [
        count.losses(events[part.sensor.channel], start_ns, end_ns) for count, part in zip(counts, decoded, strict=True)
    ]


def _write(
    path: Path, log: _Log, decoded: Decoded, losses: Losses, provenance: Mapping[str, Any], overwrite: bool
) -> RecoveredRun:
    samples, header = decoded.samples, log.header
    decoding = decoded.chain.report(samples.t, _host_ns(samples))
    faults = decoding["faults"]
    write_run(
        path,
        [samples],
        decoded.chain.info(decoded.sensor.port, header.kind),
        originals=[log.original],
        scene=header.scene,
        title=header.title,
        traps=[*_traps(log.contents.damage), *losses.traps()],
        malformed_rows=sum(count for name, count in faults.items() if not name.endswith("bytes")),
        format="wire",
        provenance={
            **_provenance(log, decoded),
            "decoding": decoding,
            "losses": dataclasses.asdict(losses),
            **provenance,
        },
        overwrite=overwrite,
    )
    with open_run(path) as run:
        run.verify()
        if run.originals() != (log.original,):
            raise RunDamaged(path, "the log inside is not the log that was read", "keep the log and recover it again")
    return RecoveredRun(decoded.sensor, path, len(samples), faults, decoding, losses)


def _host_ns(samples: Block) -> Any:
    return np.empty(0, np.int64) if samples.host_ns is None else samples.host_ns


def _provenance(log: _Log, decoded: Decoded) -> dict[str, Any]:
    header, damage = log.header, log.contents.damage
    origin = _origin_ns(decoded.samples, header)

    def at(record: Record) -> dict[str, Any]:
        return {"mono_ns": record.mono_ns, "t_s": (record.mono_ns - origin) * 1e-9, "channel": record.channel}

    return {
        "start_time": header.utc(origin),
        "clock_map": {"mono_ns": header.mono_ns, "unix_ns": header.unix_ns, "t0_mono_ns": origin},
        "recorded_with": header.version,
        "sensor": dataclasses.asdict(decoded.sensor),
        "reads": decoded.reads,
        "log": {"name": log.original.name, "sha256": log.original.sha256, **dataclasses.asdict(damage)},
        "marks": [{**at(mark), "text": mark.text()} for mark in log.notes(Kind.MARK)],
        "events": [{**at(event), **event.json()} for event in log.notes(Kind.EVENT)],
    }


def _origin_ns(samples: Block, header: LogHeader) -> int:
    """Return the host's clock at t = 0: a stamp may come late, never early, so of the first ones the earliest.

    Those after the first thousand would bring in the difference of the two clocks' rates.
    """
    if samples.host_ns is None or not len(samples):
        return header.mono_ns
    first = slice(0, 1000)
    late_ns = samples.host_ns[first] - np.rint(samples.t[first] * 1e9).astype(np.int64)
    return int(late_ns.min())


def _traps(damage: Damage) -> list[Trap]:
    found = []
    if not damage.intact:
        found.append(Trap("damaged_log", f"The wire log is damaged: {damage.describe()}.", max(1, damage.lost)))
    if not damage.ended:
        found.append(Trap("cut_short", "The recording did not end by itself; what the log holds is here."))
    return found


def _remove(path: Path, size: int) -> bool:
    """Remove a log whose every byte is in a run file that verifies; one that grew meanwhile stays."""
    with contextlib.suppress(OSError):
        if path.stat().st_size == size:
            path.unlink()
            return True
    return False
