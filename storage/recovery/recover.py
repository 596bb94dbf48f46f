"""Build run files from a wire log, even a damaged one: at the end of every recording, and after a crash.

The bytes go through the same chain as in the live view, so both give the same samples. Each run file includes the whole
log, bit for bit, so bytes that are not decoded are also preserved. Log and samples are processed in pieces, so a run
may have any length.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from acquisition.block import Block, concatenate
from acquisition.errors import AcquisitionError
from acquisition.live.calibration import Calibration
from acquisition.live.decoding import SensorChain
from acquisition.recordings.recording import FormatIssue, Original, Recording
from storage.atomic import already_exists
from storage.errors import LogGrowing, NotALog, RunDamaged, StorageError
from storage.recovery.report import LossCount, Losses, RecoveredRun, RecoverReport
from storage.run_file.reading import open_run
from storage.run_file.writing import run_writer
from storage.schema import json_text, parsed, plain
from storage.wire_log.records import SensorEntry
from storage.wire_log.scanning import FOREIGN, Damage, LogContents, read_log
from storage.wire_log.survey import LogSurvey, Part
from storage.wire_log.wire_samples import LogDecoder, Origin, chain_of


class PartReader:
    """Collects what a run file or a recording states of one part of a sensor's data, as its samples are decoded."""

    def __init__(self, part: Part, sensor: SensorEntry, chain: SensorChain) -> None:
        self.part, self.sensor, self.chain = part, sensor, chain
        self.samples = 0
        self._origin = Origin()
        self._losses = LossCount(chain.timebase.rate_hz)

    def push(self, block: Block) -> None:
        """Take the next samples."""
        self._origin.push(block)
        self.samples += len(block)
        self._losses.push(block)

    def header(self, log: LogContents, survey: LogSurvey, reads: int) -> tuple[dict[str, Any], dict[str, Any], Losses]:
        """Return the facts of a recording by name, the provenance, and the losses."""
        header, parts = survey.header, survey.parts_of(self.part.sensor)
        decoding, damage = self.chain.report(), log.damage
        begin_ns = survey.spans[self.part].begin_ns
        last = self.part == parts[-1]
        end_ns = survey.end_ns if last else survey.spans[parts[self.part.number]].begin_ns
        losses = self._losses.losses(survey.events_of(self.part), begin_ns, end_ns, last=last)
        origin = begin_ns if self._origin.ns is None else self._origin.ns
        facts = {
            "info": self.chain.info(self.sensor.port, header.kind),
            "title": header.title,
            "traps": (*_traps(damage), *losses.traps(), *_restarts(decoding)),
            "malformed_rows": sum(n for name, n in decoding["faults"].items() if not name.endswith("bytes")),
            "format": "wire",
        }
        provenance = {
            "start_time": header.utc(origin),
            "clock_map": {"mono_ns": header.mono_ns, "unix_ns": header.unix_ns, "t0_mono_ns": origin},
            "recorded_with": header.version,
            "sensor": plain(self.sensor),
            "part": {"number": self.part.number, "of": len(parts)},
            "reads": reads,
            "log": {"name": log.path.name, **dataclasses.asdict(damage)},
            **survey.provenance(origin),
            "decoding": decoding,
            "losses": dataclasses.asdict(losses),
        }
        return facts, provenance, losses


def _traps(damage: Damage) -> Iterator[FormatIssue]:
    if not damage.intact:
        yield FormatIssue("damaged_log", f"The wire log is damaged: {damage.describe()}.", max(1, damage.lost))
    if not damage.ended:
        yield FormatIssue("cut_short", "The recording was cut short; everything in its log is here.")


def _restarts(decoding: Mapping[str, Any]) -> Iterator[FormatIssue]:
    if silences := decoding["restart_silences_s"]:
        often = "once" if len(silences) == 1 else f"{len(silences)} times"
        longest = f"{max(silences):.3g} s without readings"
        yield FormatIssue("sensor_restarted", f"The sensor restarted {often}, after {longest}.", len(silences))


RUNS_PER_PASS = 4
"""Maximum number of run files written in one pass over the log; each needs some megabytes of memory."""
SHORTEST_PART_S = 10.0
"""A later part of a sensor gets a run file if it lasts this long, s; shorter ones remain in the log."""


def recover(
    log: str | os.PathLike[str] | LogContents,
    out_path: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    remove_log: bool = False,
    speed_of_sound_m_per_s: float | None = None,
    options: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> RecoverReport:
    """Build the run files of a log, which may be finished, cut short or damaged.

    The run file has the log's name with the suffix ``.h5``, or the name ``out_path``. With several sensors the channel
    comes before the suffix: ``run.0.h5``, ``run.1.h5``. Later parts of a sensor are ``run.part2.h5`` or
    ``run.0.part2.h5``. ``provenance`` becomes part of the provenance in the run files.

    ``options`` replace those of the decoders in the log, so that bytes can be read in another way.

    The log is removed with ``remove_log``, after every run file has been read back and contains the whole log.

    Raises NotALog for an unreadable log, LogGrowing for one that is still written, CalibrationError for a speed of
    sound that is out of range, RunExists or WriteFailed if a run file exists or cannot be written, and RunDamaged if
    one that was just written fails its verification. The log and existing run files are then unchanged.
    """
    if speed_of_sound_m_per_s is not None:
        Calibration(speed_of_sound_m_per_s=speed_of_sound_m_per_s)
    contents = log if isinstance(log, LogContents) else read_log(log)
    if contents.being_written():
        problem = f"a recording still writes this log ({contents.size} bytes so far)"
        raise LogGrowing(contents.path, problem, "recover it after the recording has ended")
    survey = _survey_of(contents)
    sensors = [_calibrated(sensor, survey, speed_of_sound_m_per_s) for sensor in survey.header.sensors]
    sensors = [replace(sensor, options={**sensor.options, **(options or {})}) for sensor in sensors]
    out = contents.path if out_path is None else Path(out_path)
    paths = _paths(out, survey)
    runs: dict[Path, RecoveredRun] = {}
    sha256 = contents.sha256()
    occupied = [path for path in paths.values() if not overwrite and os.path.lexists(path)]
    for path in [] if options or speed_of_sound_m_per_s is not None else occupied.copy():
        if (existing := _existing_run(path, contents, sha256)) is not None:
            occupied.remove(path)
            runs[path] = existing
    if occupied and occupied[0] == next(iter(paths.values())):
        raise already_exists(occupied[0])
    missing = [(part, path) for part, path in paths.items() if path not in (*runs, *occupied)]
    for start in range(0, len(missing), RUNS_PER_PASS):
        targets = dict(missing[start : start + RUNS_PER_PASS])
        for run in _build(contents, survey, sensors, targets, provenance or {}, overwrite=overwrite):
            _check_log_inside(run.path, contents, sha256)
            runs[run.path] = run
    if occupied:  # by now the other run files exist
        raise already_exists(occupied[0])
    return RecoverReport(
        contents.path,
        tuple(runs[path] for path in paths.values()),
        contents.damage,
        remove_log and contents.remove(),
        tuple(span.seconds for part, span in survey.spans.items() if part not in paths),
    )


def run_paths(path: Path, channels: Sequence[int]) -> list[Path]:
    """Return the paths of the run files of these channels, named after ``path``."""
    path = path if path.suffix == ".h5" else path.with_suffix(".h5")
    return [path] if len(channels) <= 1 else [path.with_name(f"{path.stem}.{channel}.h5") for channel in channels]


def _paths(out: Path, survey: LogSurvey) -> dict[Part, Path]:
    """Return the parts that get a run file, and its path: the first part of every sensor, and all long ones."""
    channels = [sensor.channel for sensor in survey.header.sensors]
    return {
        part: path if part.number == 1 else path.with_name(f"{path.stem}.part{part.number}.h5")
        for channel, path in zip(channels, run_paths(out, channels), strict=True)
        for part in _long_parts(survey, channel)
    }


def _long_parts(survey: LogSurvey, channel: int) -> list[Part]:
    """Return the first part of a sensor, and the further ones that are long."""
    parts = survey.parts_of(channel)
    return [part for part in parts if part.number == 1 or survey.spans[part].seconds >= SHORTEST_PART_S]


def _survey_of(contents: LogContents) -> LogSurvey:
    """Return the survey of a log; NotALog if both copies of its header are lost."""
    if contents.header is not None:
        return LogSurvey(contents, contents.header)
    if not contents.damage.records:
        problem = f"expected a wire log, got {contents.size} bytes without a record"
        raise NotALog(contents.path, problem, "name another file")
    problem = f"both copies of the log's header are lost ({contents.damage.describe()})"
    raise NotALog(contents.path, problem, "keep it, and name an earlier copy of this log if there is one")


def _calibrated(sensor: SensorEntry, survey: LogSurvey, speed_of_sound_m_per_s: float | None) -> SensorEntry:
    calibration = dict(survey.calibrations.get(sensor.channel, sensor.calibration))
    if speed_of_sound_m_per_s is not None:
        calibration["speed_of_sound_m_per_s"] = speed_of_sound_m_per_s
    return replace(sensor, calibration=calibration)


def _build(
    contents: LogContents,
    survey: LogSurvey,
    sensors: Sequence[SensorEntry],
    targets: Mapping[Part, Path],
    provenance: Mapping[str, Any],
    *,
    overwrite: bool,
) -> list[RecoveredRun]:
    """Write some run files in one pass over the log."""
    readers, decoder = _readers(contents, sensors, targets)
    runs = []
    with contextlib.ExitStack() as stack:
        writers = {part: stack.enter_context(run_writer(path, overwrite=overwrite)) for part, path in targets.items()}
        for part, block in decoder.blocks(contents):
            readers[part].push(block)
            writers[part].append(block)
        for part, writer in writers.items():
            reader = readers[part]
            facts, origin, losses = reader.header(contents, survey, decoder.reads[part])
            writer.keep([(contents.path.name, contents.size, contents.pieces())])
            writer.finish(**facts, scene=survey.header.scene, provenance={**origin, **provenance})
            decoding = origin["decoding"]
            runs.append(RecoveredRun(reader.sensor, part.number, writer.path, reader.samples, decoding, losses))
    return runs


def _readers(
    contents: LogContents, sensors: Sequence[SensorEntry], targets: Collection[Part]
) -> tuple[dict[Part, PartReader], LogDecoder]:
    """Return what reads some parts of a log."""
    by_channel = {sensor.channel: sensor for sensor in sensors}
    try:
        chains = {part: chain_of(by_channel[part.sensor]) for part in targets}
    except AcquisitionError as error:
        raise NotALog(contents.path, f"header.sensors: {error}", FOREIGN) from error
    readers = {part: PartReader(part, by_channel[part.sensor], chain) for part, chain in chains.items()}
    return readers, LogDecoder(by_channel, chains.get, whole=True)


def open_log(path: str | os.PathLike[str]) -> tuple[LogContents, LogSurvey]:
    """Return a log, which may still be written, and its survey; NotALog says why a log cannot be decoded."""
    contents = read_log(path)
    survey = _survey_of(contents)
    _readers(contents, survey.header.sensors, survey.spans)
    return contents, survey


def read_longest_part(
    contents: LogContents, survey: LogSurvey, channel: int
) -> tuple[Recording, dict[str, Any], int, int]:
    """Decode the longest part of a sensor in memory: its recording and provenance, its number, and the count of parts.

    Parts that would get no run file do not count.
    """
    sensors = [_calibrated(sensor, survey, None) for sensor in survey.header.sensors]
    targets = _long_parts(survey, channel)
    readers, decoder = _readers(contents, sensors, targets)
    blocks: dict[Part, list[Block]] = {part: [] for part in targets}
    for part, block in decoder.blocks(contents):
        readers[part].push(block)
        blocks[part].append(block)
    longest = max(targets, key=lambda part: readers[part].samples)
    facts, provenance, _ = readers[longest].header(contents, survey, decoder.reads[longest])
    original = Original(contents.path.name, b"".join(contents.pieces()))
    recording = Recording(
        **facts,
        path=str(contents.path),
        channel="distance",
        samples=concatenate(blocks[longest]),
        originals=(original,),
    )
    # The provenance of a log is that of its run file, which has lists and plain numbers.
    return recording, parsed(json_text(provenance).encode(), "provenance"), longest.number, len(targets)


def _check_log_inside(path: Path, contents: LogContents, sha256: str) -> None:
    with open_run(path) as run:
        run.verify()
        inside = [(entry.name, entry.size, entry.sha256) for entry in run.header.originals]
    if inside != [(contents.path.name, contents.size, sha256)]:
        raise RunDamaged(path, f"the log inside differs from {contents.path}", "keep the log and recover it again")


def _existing_run(path: Path, contents: LogContents, sha256: str) -> RecoveredRun | None:
    """Return an existing run file if it contains this whole log, as after a killed recovery; otherwise None."""
    try:
        _check_log_inside(path, contents, sha256)
        with open_run(path) as run:
            noted = run.provenance
            losses = Losses(**{**noted["losses"], "away": tuple(noted["losses"]["away"])})
            sensor = SensorEntry(**noted["sensor"])
            part = Part(sensor.channel, noted["part"]["number"])
            return RecoveredRun(sensor, part.number, path, len(run), noted["decoding"], losses, existed=True)
    except (StorageError, KeyError, TypeError, ValueError):
        return None
