"""From a wire log, however torn, to a run file: at the end of every recording, and after a crash.

The bytes go through the very chain that showed them live, so both give the same samples. The log itself travels
inside the run file, bit for bit: nothing that decoding leaves out is lost. Log and samples pass through memory a
stretch at a time, so that a run may be of any length.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from acquisition.errors import AcquisitionError
from acquisition.live.calibration import Calibration
from storage.atomic import remove_leftovers
from storage.errors import RunDamaged, RunExists, StorageError
from storage.recovery.building import SensorRun
from storage.recovery.losses import Losses
from storage.recovery.recovered import RecoveredRun, RecoverReport
from storage.run_file.reading import open_run
from storage.run_file.writing import run_writer
from storage.schema import ValueRefused
from storage.wire_log.log_file import is_being_written
from storage.wire_log.notes import Notes
from storage.wire_log.records import Kind, LogHeader, SensorEntry
from storage.wire_log.scanning import LogContents, NotALog, read_log
from storage.wire_log.wire_samples import LogDecoder, chains_of

__all__ = ["LogGrowing", "RecoverReport", "RecoveredRun", "recover", "run_paths", "verify_against_log"]

AT_ONCE = 4
"""So many sensors' run files are written in one pass over the log: each holds some megabytes of samples back."""
FOREIGN = "springmass writes no such log; ask where it comes from"


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
    acquisition.errors.CalibrationError
        If sound is never so slow or fast.
    LogGrowing
        If a recording still writes the log.
    NotALog
        If there is no log, or nothing in it can be read.
    RunExists, WriteFailed
        If a run file stands there already or cannot be written. What stood there stands, and so does the log.
    RunDamaged
        If a run file just written does not read back as it should. The log stands.
    """
    if speed_of_sound_m_per_s is not None:
        Calibration(speed_of_sound_m_per_s=speed_of_sound_m_per_s)
    contents = log if isinstance(log, LogContents) else read_log(log)
    if not growing:
        _demand_finished(contents)
    known = _header(contents, header)
    notes = _notes(contents)
    leftovers = remove_leftovers(contents.path.absolute().parent)
    sensors = _sensors(known.sensors, notes, speed_of_sound_m_per_s)
    out = contents.path if out_path is None else Path(out_path)
    paths = _paths(out, known.sensors, sensors)
    runs: dict[Path, RecoveredRun] = {}
    taken: list[Path] = []
    for sensor, path in zip(sensors, paths, strict=True):
        if not overwrite and os.path.lexists(path):
            stood = _standing(path, sensor, contents) if speed_of_sound_m_per_s is None else None
            if stood is None:
                taken.append(path)
            else:
                runs[path] = stood
    if paths[0] in taken:
        raise _exists(paths[0])
    missing = [(sensor, path) for sensor, path in zip(sensors, paths, strict=True) if path not in (*runs, *taken)]
    for start in range(0, len(missing), AT_ONCE):
        for run in _build(contents, known, notes, missing[start : start + AT_ONCE], provenance or {}, overwrite):
            _demand_held(run.path, contents)
            runs[run.path] = run
    if taken:  # the others are there by then
        raise _exists(taken[0])
    return RecoverReport(
        contents.path,
        tuple(runs[path] for path in paths),
        contents.damage,
        notes.counts[Kind.MARK],
        notes.counts[Kind.EVENT],
        remove_log and _remove(contents),
        len(contents.parts),
        leftovers,
        {sensor.channel: notes.parts[sensor.channel] for sensor in sensors[len(known.sensors) :]},
    )


def _notes(contents: LogContents) -> Notes:
    """Read the log once for what it says besides bytes: a calibration at its end counts for its first sample."""
    notes = Notes()
    try:
        for record in contents:
            if record.kind is not Kind.DATA:
                notes.take(record)
    except ValueRefused as error:
        raise NotALog(contents.path, str(error), FOREIGN) from error
    return notes


def _sensors(header: Sequence[SensorEntry], notes: Notes, speed_of_sound_m_per_s: float | None) -> list[SensorEntry]:
    """Return the sensors of the header, then those that came back as others on their ports, as they are calibrated."""
    known: dict[int, SensorEntry] = {}

    def add(sensor: SensorEntry) -> None:
        calibration = notes.calibrations.get(sensor.channel, sensor.calibration)
        known[sensor.channel] = replace(sensor, calibration=calibration)

    for sensor in header:
        add(sensor)
    for channel, of in sorted(notes.parts.items()):
        if channel not in known and of in known:
            add(replace(known[of], channel=channel))
    if speed_of_sound_m_per_s is None:
        return list(known.values())
    other = {"speed_of_sound_m_per_s": speed_of_sound_m_per_s}
    return [replace(each, calibration={**each.calibration, **other}) for each in known.values()]


def _paths(out: Path, header: Sequence[SensorEntry], sensors: Sequence[SensorEntry]) -> list[Path]:
    """Return the run file of each sensor."""
    (single,) = run_paths(out, [0])
    parts = [_of_channel(single, sensor.channel) for sensor in sensors[len(header) :]]
    return run_paths(out, [sensor.channel for sensor in header]) + parts


def _exists(path: Path) -> RunExists:
    demand = "a new run file was to be written, but a file stands there"
    return RunExists(path, demand, "choose another name or allow overwriting")


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


def _standing(path: Path, sensor: SensorEntry, contents: LogContents) -> RecoveredRun | None:
    """Return the run file that stands there if it holds all of this log, as a killed recovery leaves it; else None."""
    try:
        _demand_held(path, contents)
        with open_run(path) as run:
            decoding, lost = run.provenance["decoding"], run.provenance["losses"]
            losses = Losses(**{**lost, "away": tuple(lost["away"])})
            return RecoveredRun(sensor, path, len(run), decoding["faults"], decoding, losses, stood=True)
    except (StorageError, KeyError, TypeError):
        return None


def _header(contents: LogContents, stand_in: LogHeader | None) -> LogHeader:
    header = contents.header or stand_in
    if header is not None:
        return header
    path = contents.path
    if not contents.damage.records:
        raise NotALog(path, f"a wire log was demanded, got {contents.size} bytes without one record", "name another")
    demand = f"the log's header is lost in all its copies ({contents.damage.describe()})"
    raise NotALog(path, demand, "say which sensors were recorded")


def run_paths(path: Path, channels: Sequence[int]) -> list[Path]:
    """Return the run files that a log of these channels becomes, named after ``path``."""
    path = path if path.suffix == ".h5" else path.with_suffix(".h5")
    if len(channels) <= 1:
        return [path]
    return [_of_channel(path, channel) for channel in channels]


def _of_channel(path: Path, channel: int) -> Path:
    return path.with_name(f"{path.stem}.{channel}{path.suffix}")


def _build(
    contents: LogContents,
    header: LogHeader,
    notes: Notes,
    targets: Sequence[tuple[SensorEntry, Path]],
    provenance: Mapping[str, Any],
    overwrite: bool,
) -> list[RecoveredRun]:
    """Write the run files of some sensors in one pass over the log."""
    sensors = [sensor for sensor, _ in targets]
    try:
        chains = chains_of(sensors)
    except AcquisitionError as error:
        raise NotALog(contents.path, f"header.sensors: {error}", FOREIGN) from error
    with contextlib.ExitStack() as stack:
        writers = [stack.enter_context(run_writer(path, overwrite=overwrite)) for _, path in targets]
        runs = [SensorRun(*each) for each in zip(writers, [contents] * len(writers), sensors, chains, strict=True)]

        def taken(part: int, data: bytes) -> None:
            for run in runs:
                run.take(part, data)

        decoder = LogDecoder(sensors, chains)
        for number, block in decoder.blocks(contents.records(taken)):
            runs[number].append(block)
        ends = zip(runs, decoder.reads, strict=True)
        return [run.finish(header, notes, reads, decoder.last_ns, provenance) for run, reads in ends]


def _remove(contents: LogContents) -> bool:
    """Remove a log whose every byte is in run files that verify; one that grew meanwhile stays."""
    with contextlib.suppress(OSError):
        if all(part.in_place() for part in contents.parts):
            for part in contents.parts:  # the first file first: without it, the others are not taken for all of a run
                part.path.unlink()
            return True
    return False
