"""Build a run file from a wire log, even a damaged one: at the end of every recording, and after a crash.

The bytes go through the same chain as in the live view, so both give the same samples. The run file includes the whole
log, bit for bit, so bytes that are not decoded are also preserved. Log and samples are processed in pieces, so a run
may have any length.
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

SENSORS_PER_PASS = 4
"""Maximum number of run files written in one pass over the log; each needs some megabytes of memory."""
FOREIGN = "springmass writes no such log; ask where it comes from"


class LogGrowing(StorageError):
    """A log that a recording still writes: a run file made now would be incomplete and take the recording's place."""


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
    """Build the run file of a log, or one run file per sensor if there are several sensors.

    Parameters
    ----------
    log : str, PathLike or LogContents
        The log, which may be finished, cut short or damaged.
    out_path : str or PathLike, optional
        The run file; by default the log's name with the suffix ``.h5``. With several sensors the channel comes before
        the suffix: ``run.0.h5``, ``run.1.h5``. If a single sensor was replaced by another one on its port, the files
        are ``run.h5`` and ``run.1.h5``.
    overwrite : bool
        Whether existing run files may be replaced.
    remove_log : bool
        Whether to remove the log after all run files, each of which contains it, are verified.
    header : LogHeader, optional
        Header to use if every copy of the header in the log is lost.
    speed_of_sound_m_per_s : float, optional
        Speed of sound for echo times, m/s; replaces the value in the log.
    provenance : mapping, optional
        Further entries of the run file's provenance: software, version, ...
    growing : bool
        Whether to accept a log that a recording still writes, and to use its records so far.

    Raises
    ------
    acquisition.errors.CalibrationError
        If the speed of sound is out of range.
    LogGrowing
        If a recording still writes the log.
    NotALog
        If the log does not exist or is unreadable.
    RunExists, WriteFailed
        If a run file exists or cannot be written. The existing file and the log are then unchanged.
    RunDamaged
        If a run file that was just written fails its verification. The log is kept.
    """
    if speed_of_sound_m_per_s is not None:
        Calibration(speed_of_sound_m_per_s=speed_of_sound_m_per_s)
    contents = log if isinstance(log, LogContents) else read_log(log)
    if not growing:
        _check_finished(contents)
    known = _header(contents, header)
    notes = _notes(contents)
    leftovers = remove_leftovers(contents.path.absolute().parent)
    sensors = _sensors(known.sensors, notes, speed_of_sound_m_per_s)
    out = contents.path if out_path is None else Path(out_path)
    paths = _paths(out, known.sensors, sensors)
    runs: dict[Path, RecoveredRun] = {}
    occupied: list[Path] = []
    for sensor, path in zip(sensors, paths, strict=True):
        if not overwrite and os.path.lexists(path):
            existing = _existing_run(path, sensor, contents) if speed_of_sound_m_per_s is None else None
            if existing is None:
                occupied.append(path)
            else:
                runs[path] = existing
    if paths[0] in occupied:
        raise _already_exists(paths[0])
    missing = [(sensor, path) for sensor, path in zip(sensors, paths, strict=True) if path not in (*runs, *occupied)]
    for start in range(0, len(missing), SENSORS_PER_PASS):
        for run in _build(
            contents, known, notes, missing[start : start + SENSORS_PER_PASS], provenance or {}, overwrite
        ):
            _check_log_inside(run.path, contents)
            runs[run.path] = run
    if occupied:  # by now the other run files exist
        raise _already_exists(occupied[0])
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
    """Read the marks and events of the log first, because a calibration at its end applies to all samples."""
    notes = Notes()
    try:
        for record in contents:
            if record.kind is not Kind.DATA:
                notes.take(record)
    except ValueRefused as error:
        raise NotALog(contents.path, str(error), FOREIGN) from error
    return notes


def _sensors(header: Sequence[SensorEntry], notes: Notes, speed_of_sound_m_per_s: float | None) -> list[SensorEntry]:
    """Return the calibrated sensors: first those of the header, then those that replaced them."""
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


def _already_exists(path: Path) -> RunExists:
    return RunExists(path, "already exists", "choose another name or allow overwriting")


def _check_finished(contents: LogContents) -> None:
    for part in contents.parts:
        with contextlib.suppress(OSError), part.open() as file:  # a missing file is reported when it is read
            if is_being_written(file):
                problem = f"a recording still writes this log ({contents.size} bytes so far)"
                raise LogGrowing(contents.path, problem, "recover it after the recording has ended")


def verify_against_log(path: str | os.PathLike[str], log_path: str | os.PathLike[str]) -> None:
    """Read a whole run file and compare it with the log from which it was made.

    The log may be deleted only after this.

    Parameters
    ----------
    path : str or PathLike
        The run file.
    log_path : str or PathLike
        The first file of the log.

    Raises
    ------
    NotALog
        If the log cannot be read.
    NotARun, RunDamaged
        If the run file does not verify, or the log inside it differs from the one on the disk.
    """
    _check_log_inside(Path(path), read_log(log_path))


def _check_log_inside(path: Path, contents: LogContents) -> None:
    with open_run(path) as run:
        run.verify()
        inside = [(entry.name, entry.size, entry.sha256) for entry in run.header.originals]
    if inside != [(part.path.name, part.size, part.sha256()) for part in contents.parts]:
        raise RunDamaged(path, f"the log inside differs from {contents.path}", "keep the log and recover it again")


def _existing_run(path: Path, sensor: SensorEntry, contents: LogContents) -> RecoveredRun | None:
    """Return an existing run file if it contains this whole log, as after a killed recovery; otherwise None."""
    try:
        _check_log_inside(path, contents)
        with open_run(path) as run:
            decoding, lost = run.provenance["decoding"], run.provenance["losses"]
            losses = Losses(**{**lost, "away": tuple(lost["away"])})
            return RecoveredRun(sensor, path, len(run), decoding["faults"], decoding, losses, existed=True)
    except (StorageError, KeyError, TypeError):
        return None


def _header(contents: LogContents, stand_in: LogHeader | None) -> LogHeader:
    header = contents.header or stand_in
    if header is not None:
        return header
    path = contents.path
    if not contents.damage.records:
        raise NotALog(path, f"expected a wire log, got {contents.size} bytes without a record", "name another file")
    problem = f"all copies of the log's header are lost ({contents.damage.describe()})"
    raise NotALog(path, problem, "state which sensors were recorded")


def run_paths(path: Path, channels: Sequence[int]) -> list[Path]:
    """Return the paths of the run files of these channels, named after ``path``."""
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
    """Remove a log whose bytes are all in verified run files, unless it has grown or been replaced since then."""
    with contextlib.suppress(OSError):
        if all(part.in_place() for part in contents.parts):
            for part in contents.parts:  # begin with the first file, so that the others do not look like a whole log
                part.path.unlink()
            return True
    return False
