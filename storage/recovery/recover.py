"""From a wire log, however torn, to a run file: at the end of every recording, and after a crash.

The bytes go through the very chain that showed them live, so both give the same samples. The log itself travels
inside the run file, bit for bit: nothing that decoding leaves out is lost. Log and samples pass through memory a
stretch at a time, so that a run may be of any length.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from acquisition.errors import AcquisitionError
from storage.atomic import remove_leftovers
from storage.checked import ValueRefused
from storage.errors import RunDamaged, RunExists, StorageError
from storage.recovery.building import SensorRun
from storage.recovery.losses import Losses
from storage.recovery.recovered import RecoveredRun, RecoverReport
from storage.run_file.reading import open_run
from storage.run_file.writing import RunWriter, run_writer
from storage.wire_log.log_file import is_being_written
from storage.wire_log.notes import Notes
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.scanning import LogContents, NotALog, read_log
from storage.wire_log.wire_samples import LogDecoder, chains_of

__all__ = ["LogGrowing", "RecoverReport", "RecoveredRun", "recover", "run_paths", "verify_against_log"]

AT_ONCE = 4
"""So many sensors' run files are written in one pass over the log: each holds some megabytes of samples back."""


class LogGrowing(StorageError):
    """A log that a recording still writes: its run file would lack what comes and stand in the recording's way."""


def recover(
    log: str | os.PathLike[str] | LogContents,
    out_path: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    remove_log: bool = False,
    header: LogHeader | None = None,
    speed_of_sound_m_per_s: float | None = None,
    provenance: Mapping[str, Any] | None = None,
    growing: bool = False,
) -> RecoverReport:
    """Build the run file of a log, or one for each sensor where several were recorded.

    Parameters
    ----------
    log : str, PathLike or LogContents
        The log; finished, torn or damaged.
    out_path : str or PathLike, optional
        The run file; left out, the log's name with ``.h5``. With several sensors their channels come before the
        suffix: ``run.0.h5``, ``run.1.h5``. So they do of a sensor that came back as another on the port of the only
        one: ``run.h5``, ``run.1.h5``.
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
    growing : bool
        Whether to take what there is of a log that a recording still writes.

    Raises
    ------
    LogGrowing
        If a recording still writes the log.
    NotALog
        If there is no log, or nothing in it can be read.
    RunExists, WriteFailed
        If a run file stands there already or cannot be written. What stood there stands, and so does the log.
    RunDamaged
        If a run file just written does not read back as it should. The log stands.
    """
    contents = log if isinstance(log, LogContents) else read_log(log)
    if not growing:
        _demand_finished(contents)
    known = _Log(contents, _header(contents, header), provenance or {})
    leftovers = remove_leftovers(contents.path.absolute().parent)
    other = {} if speed_of_sound_m_per_s is None else {"speed_of_sound_m_per_s": speed_of_sound_m_per_s}
    sensors = known.header.sensors
    out = contents.path if out_path is None else Path(out_path)
    paths = run_paths(out, [each.channel for each in sensors])
    runs = _runs(known, sensors, paths, other, overwrite)
    if not known.notes.counts:  # all run files stood there
        for record in contents:
            if record.kind is not Kind.DATA:
                known.notes.take(record)
    if parts := _parts(known):
        (only,) = run_paths(out, [0])
        runs += _runs(known, parts, [_of_channel(only, part.channel) for part in parts], other, overwrite)
    damage = contents.damage
    removed = remove_log and _remove(contents)
    return RecoverReport(
        contents.path,
        tuple(runs),
        damage,
        known.notes.counts[Kind.MARK],
        known.notes.counts[Kind.EVENT],
        removed,
        len(contents.parts),
        leftovers,
        {part.channel: known.notes.parts[part.channel] for part in parts},
    )


def _runs(
    log: _Log, sensors: Sequence[SensorEntry], paths: Sequence[Path], other: Mapping[str, Any], overwrite: bool
) -> list[RecoveredRun]:
    """Return the run files of some sensors, those that stand there as they are and the others built."""
    runs = {} if overwrite else _standing(paths, sensors, log.contents, other)
    missing = [number for number in range(len(sensors)) if number not in runs]
    for start in range(0, len(missing), AT_ONCE):
        numbers = missing[start : start + AT_ONCE]
        built = _build(log, [sensors[n] for n in numbers], [paths[n] for n in numbers], other, overwrite)
        for number, run in zip(numbers, built, strict=True):
            _demand_held(run.path, log.contents)
            runs[number] = run
    return [runs[number] for number in range(len(sensors))]


def _parts(log: _Log) -> list[SensorEntry]:
    """Return the sensors that came back as others on the ports of those that the header names."""
    known = {sensor.channel: sensor for sensor in log.header.sensors}
    parts = []
    for channel, of in sorted(log.notes.parts.items()):
        if channel not in known and (before := known.get(of)) is not None:
            calibration = log.notes.calibrations.get(of, before.calibration)
            known[channel] = dataclasses.replace(before, channel=channel, calibration=calibration)
            parts.append(known[channel])
    return parts


def _demand_finished(contents: LogContents) -> None:
    for part in contents.parts:
        with contextlib.suppress(OSError), part.open() as file:  # that it is gone is for the reading to say
            if is_being_written(file):
                demand = f"a recording still writes the log, got it at {contents.size} bytes"
                raise LogGrowing(contents.path, demand, "recover it when the recording has ended")


def verify_against_log(path: str | os.PathLike[str], log_path: str | os.PathLike[str]) -> None:
    """Read a run file back, all of it, and hold it against the log that it was made from.

    After this, and not before, the log may be deleted.

    Parameters
    ----------
    path : str or PathLike
        The run file.
    log_path : str or PathLike
        The log, with all the files that it lies in.

    Raises
    ------
    NotALog
        If the log cannot be read.
    NotARun, RunDamaged
        If the run file does not verify, or the log inside is not, bit for bit, the one on the disk.
    """
    _demand_held(Path(path), read_log(log_path))


def _demand_held(path: Path, contents: LogContents) -> None:
    with open_run(path) as run:
        run.verify()
        held = [(entry.name, entry.size, entry.sha256) for entry in run.header.originals]
    if held != [(part.path.name, part.size, part.sha256()) for part in contents.parts]:
        raise RunDamaged(path, f"the log inside is not {contents.path}", "keep the log and recover it again")


def _standing(
    paths: Sequence[Path], sensors: Sequence[SensorEntry], contents: LogContents, other: Mapping[str, Any]
) -> dict[int, RecoveredRun]:
    """Return the run files, by number, that stand there and hold all of this log: a build that was killed made them.

    Raises
    ------
    RunExists
        If something else stands there. What comes meanwhile is refused by the writing itself.
    """
    found = {}
    for number, (path, sensor) in enumerate(zip(paths, sensors, strict=True)):
        if not os.path.lexists(path):
            continue
        try:
            if other:
                raise RunExists(path, "", "")
            _demand_held(path, contents)
            with open_run(path) as run:
                decoding, lost = run.provenance["decoding"], run.provenance["losses"]
                losses = Losses(**{**lost, "away": tuple(lost["away"])})
                found[number] = RecoveredRun(sensor, path, len(run), decoding["faults"], decoding, losses, stood=True)
        except (StorageError, KeyError, TypeError) as error:
            demand = "a new run file was to be written, but a file stands there"
            raise RunExists(path, demand, "choose another name or allow overwriting") from error
    return found


def _header(contents: LogContents, stand_in: LogHeader | None) -> LogHeader:
    header = contents.header or stand_in
    if header is not None:
        return header
    path = contents.path
    if not contents.damage.records:
        raise NotALog(path, f"a wire log was demanded, got {contents.size} bytes without one record", "name another")
    demand = f"the log's header is lost in all its copies ({contents.damage.describe()})"
    raise NotALog(path, demand, "say which sensors were recorded")


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
    return [_of_channel(path, channel) for channel in channels]


def _of_channel(path: Path, channel: int) -> Path:
    return path.with_name(f"{path.stem}.{channel}{path.suffix}")


@dataclasses.dataclass(slots=True, eq=False)
class _Log:
    """A log on its way into run files."""

    contents: LogContents
    header: LogHeader
    provenance: Mapping[str, Any]
    notes: Notes = dataclasses.field(default_factory=Notes)


class _Again(Exception):
    """What was written was worked out with a calibration that did not last."""


def _build(
    log: _Log, sensors: Sequence[SensorEntry], paths: Sequence[Path], other: Mapping[str, Any], overwrite: bool
) -> list[RecoveredRun]:
    """Write the run files of some sensors in one pass over the log."""
    while True:
        calibrated = _calibrated(sensors, log.notes.calibrations, other)
        with contextlib.suppress(_Again), contextlib.ExitStack() as stack:
            writers = [stack.enter_context(run_writer(path, overwrite=overwrite)) for path in paths]
            runs, decoder = _poured(log, calibrated, writers)
            # Events are known when the log was read; a calibration among them is rare, so only then it is read again.
            if _calibrated(sensors, log.notes.calibrations, other) != calibrated:
                raise _Again
            told = zip(runs, decoder.reads, strict=True)
            return [run.finish(log.header, log.notes, reads, decoder.last_ns, log.provenance) for run, reads in told]


def _poured(
    log: _Log, sensors: Sequence[SensorEntry], writers: Sequence[RunWriter]
) -> tuple[list[SensorRun], LogDecoder]:
    """Read the log once, into all the run files."""
    contents, log.notes = log.contents, Notes()
    remedy = "springmass writes no such log; ask where it comes from"
    try:
        chains = chains_of(sensors)
    except AcquisitionError as error:
        raise NotALog(contents.path, f"header.sensors: {error}", remedy) from error
    runs = [SensorRun(*each) for each in zip(writers, [contents] * len(writers), sensors, chains, strict=True)]

    def taken(part: int, data: bytes) -> None:
        for run in runs:
            run.take(part, data)

    decoder = LogDecoder(sensors, chains, log.notes.take)
    try:
        for number, block in decoder.blocks(contents.records(taken)):
            runs[number].append(block)
    except ValueRefused as error:
        raise NotALog(contents.path, str(error), remedy) from error
    return runs, decoder


def _remove(contents: LogContents) -> bool:
    """Remove a log whose every byte is in run files that verify; one that grew meanwhile stays."""
    with contextlib.suppress(OSError):
        if all(part.in_place() for part in contents.parts):
            for part in contents.parts:  # the first file first: without it, the others are not taken for all of a run
                part.path.unlink()
            return True
    return False
