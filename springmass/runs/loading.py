"""Load a recording, a run file or a wire log, with everything that its reader noticed."""

from __future__ import annotations

import hashlib
import math
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.decoders.family import RESONATOR_PPM
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.live.calibration import SPEED_OF_SOUND_M_PER_S, Calibration
from acquisition.live.clock_fit import fit_clock
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.regular_file import open_regular
from pipeline.track import Track
from springmass.errors import UNREADABLE, ProgramError, complain, detail, tell
from springmass.layout import STDIN, part
from springmass.runs.inputs import kind_of
from springmass.runs.options import READ, ReadOptions
from springmass.runs.scenes import about_of
from storage.errors import RunDamaged
from storage.recovery.recover import recover
from storage.run_file.layout import CHECKED
from storage.run_file.reading import open_run

UNVERIFIED = "unverified"
NAMED = 5  # maximum number of differences that a message names
_OF_FILES = frozenset({"velocity", "channel", "rate_hz", "unit", "run", "time", "time_unit", "delimiter", "decimal"})


@dataclass(frozen=True, eq=False)
class Loaded:
    """One input that has been read: the samples as they were recorded, and the track that the pipeline analyses.

    ``format`` is the family that read it, "run" for a run file, "wire" for a wire log, "memory" for arrays;
    ``recorded_format`` is the family of the recording inside a run file. ``scene`` comes from the notes next to the
    file, or else from inside a run file. ``kept`` are the original files; those inside a run file are read when they
    are needed. ``sha256`` is the digest of the file's bytes, empty for arrays and for an empty wire log.
    """

    path: Path
    format: str
    info: SourceInfo
    channel: str
    title: str
    samples: Block
    track: Track
    traps: tuple[Trap, ...] = ()
    malformed_rows: int = 0
    scene: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recorded_format: str = ""
    sha256: str = ""
    kept: tuple[Original, ...] | None = ()

    @property
    def source(self) -> str:
        """The path as it was given; empty for arrays, which have none."""
        return "" if self.path == Path() else str(self.path)

    @property
    def originals(self) -> tuple[Original, ...]:
        """Exact copies of the original files; those inside a run file are checked as they are read."""
        if self.kept is not None:
            return self.kept
        if _sha256_of(self.path) != self.sha256:
            raise ProgramError(f"{self.path}: the file has changed since it was loaded; load it again", UNREADABLE)
        with open_run(self.path, unverified=any(trap.code == UNVERIFIED for trap in self.traps)) as run:
            return run.originals()

    def samples_in_blocks(self, size: int = 1024) -> Iterator[Block]:
        """Yield the samples in blocks of at most ``size``."""
        for start in range(0, len(self.samples), size):
            yield self.samples[start : start + size]


def load(path: str | Path, options: ReadOptions = READ, *, scene_given: bool = False) -> Loaded:
    """Read a recording, a run file or a wire log, or standard input.

    All digests of a run file are checked before any sample is used. With ``scene_given`` the caller uses another scene,
    and none is said to be read from the notes. NeedsAnswer says what the file leaves open and the options do not give.
    """
    if str(path) == STDIN:
        return _load_stdin(options)
    where = Path(path)
    kind = kind_of(where)
    if kind == "run":
        _refuse(where, "a run file", options, ())
        loaded = _load_run(where, unverified=options.unverified)
    elif kind == "wire":
        _refuse(where, "a wire log", options, ("channel",))
        loaded = _load_wire(where, options.channel)
    else:
        stated = {name: getattr(options, name) for name in _OF_FILES - {"velocity"}}
        loaded = _from_recording(where, open_recording(where, velocity_path=options.velocity, **stated))
    for trap in loaded.traps:
        if trap.code == UNVERIFIED:
            complain(f"{where}: {trap.message}")
    about = about_of(where)
    if described := about.described(scene=not scene_given):
        tell(f"{about.path}: {described} read from the notes next to the file")
    if about.described():
        scene = loaded.scene if about.scene is None else about.scene.to_mapping()
        marks = [*loaded.provenance.get("marks", ()), *({"t_s": t_s, "text": text} for t_s, text in about.marks)]
        noted = {"marks": marks} if marks else {}
        if about.notes:
            noted["notes"] = list(about.notes)
        loaded = replace(loaded, scene=scene, provenance={**loaded.provenance, **noted})
    summary = f"{loaded.format}, {len(loaded.samples)} samples of {loaded.samples.quantity}"
    detail(f"read: {where}: {summary} at {loaded.info.rate_hz:g} Hz, clock: {loaded.info.clock}")
    return within(loaded, options)


def within(loaded: Loaded, options: ReadOptions) -> Loaded:
    """Return an input with its track cut to the chosen seconds, and with the stated error of its clock."""
    track = cut(loaded.track, options.from_s, options.to_s, where=loaded.source or "arrays")
    if options.clock_ppm is not None:
        track = replace(track, clock_limit=options.clock_ppm * 1e-6)
    return replace(loaded, track=track)


def _load_stdin(options: ReadOptions) -> Loaded:
    """Load from standard input by way of a temporary file, because the formats need a seekable file."""
    with tempfile.TemporaryDirectory(prefix="springmass-") as folder:
        spooled = Path(folder) / "stdin"
        if sys.stdin is None:
            raise ProgramError("standard input is closed; name a file", UNREADABLE)
        with open(spooled, "wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        try:
            loaded = load(spooled, options)
        except NeedsAnswer as error:
            raise NeedsAnswer(replace(error.question, path=STDIN), line=error.line) from None
        except FormatError as error:
            raise type(error)(STDIN, error.problem, error.remedy, line=error.line) from None
        kept = loaded.originals  # read while the file exists
    return replace(loaded, path=Path(STDIN), kept=kept)


def sample_data() -> Path:
    """Return the folder of the bundled recordings."""
    folder = part("sample_data")
    if (folder / "undamped_simulated_position.txt").is_file():
        return folder
    raise ProgramError(f"{folder}: the bundled recordings are missing; install springmass again", UNREADABLE)


def _refuse(path: Path, what: str, options: ReadOptions, allowed: Sequence[str]) -> None:
    """Refuse options that describe a file which already states everything itself."""
    given = [name for name in options.given() if name in _OF_FILES and name not in allowed]
    if given:
        raise ProgramError(f"{path}: {what} states everything, got {', '.join(given)} too; leave that out")


def _from_recording(path: Path, recording: Recording) -> Loaded:
    origin = {"start_time": recording.start_time, "recorded_run": recording.run}
    return Loaded(
        path,
        recording.format,
        recording.info,
        recording.channel,
        recording.title,
        recording.samples,
        to_track(recording.samples, recording.info, recorded_format=recording.format),
        recording.traps,
        recording.malformed_rows,
        provenance={name: value for name, value in origin.items() if value},
        recorded_format=recording.format,
        sha256=recording.originals[0].sha256,
        kept=recording.originals,
    )


def _load_run(path: Path, *, unverified: bool = False) -> Loaded:
    sha256 = _sha256_of(path)
    with open_run(path, unverified=unverified) as run:
        try:
            samples, traps = run.samples(), run.traps
            if unverified:
                traps += _unverified(path, run.differences())
            else:
                run.verify(but=CHECKED)
        except RunDamaged as error:
            if unverified:
                raise
            remedy = f"{error.remedy}, or look at it as it is with --unverified"
            raise RunDamaged(path, error.problem, remedy) from error
        return Loaded(
            path,
            "run",
            run.info,
            run.header.channel,
            run.header.title,
            samples,
            to_track(samples, run.info, recorded_format=run.header.format, provenance=run.provenance),
            traps,
            run.header.malformed_rows,
            run.header.scene,
            run.provenance,
            run.header.format,
            sha256,
            kept=None,
        )


def _unverified(path: Path, differing: Sequence[RunDamaged]) -> tuple[Trap, ...]:
    """Return a trap that names the parts of a run file with a checksum mismatch."""
    if not differing:
        return ()
    named = "; ".join(error.problem for error in differing[:NAMED])
    more = f"; and {len(differing) - NAMED} more" if len(differing) > NAMED else ""
    message = f"{path.name} was changed or damaged after it was written ({named}{more}); it was read, as you asked."
    return (Trap(UNVERIFIED, message, len(differing)),)


def _sha256_of(path: Path) -> str:
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _load_wire(path: Path, channel: str | None) -> Loaded:
    """Recover a log into a temporary run file and load that; the log is not changed."""
    with tempfile.TemporaryDirectory(prefix="springmass-") as folder:
        report = recover(path, Path(folder) / "run.h5", growing=True)
        ports = {str(run.sensor.channel): run.sensor.port for run in report.runs}
        wanted = [number for number, port in ports.items() if channel in (None, number, port)]
        if len(wanted) != 1:
            sensors = ", ".join(f"{number} at {port}" for number, port in ports.items())
            refused = "" if channel is None else f'channel "{channel}" is not in the log, '
            need = MissingItem(Missing.CHANNEL, tuple(ports), next(iter(ports)))
            raise NeedsAnswer(Question(str(path), (need,), reason=f"{refused}the log holds the sensors {sensors}"))
        parts = report.parts_of(int(wanted[0]))
        longest = max(parts, key=lambda run: run.samples)
        if len(parts) > 1:
            tell(f"{path}: the sensor came back; this is its longest part, number {longest.part}")
        loaded = _load_run(longest.path)
        originals = loaded.originals  # read while the run file exists
    return replace(
        loaded,
        path=path,
        format="wire",
        recorded_format="wire",
        sha256=originals[0].sha256 if originals else "",
        kept=originals,
    )


def cut(track: Track, from_s: float | None, to_s: float | None, *, where: object) -> Track:
    """Return the samples between two times, s, both included; ``where`` is named in the error if there are none."""
    low = -np.inf if from_s is None else from_s
    high = np.inf if to_s is None else to_s
    part = between(track, low, high)
    if not len(part) and (from_s, to_s) != (None, None):
        times = track.t[np.isfinite(track.t)]
        span = f"spans {times.min():g} to {times.max():g} s" if times.size else "holds no sample"
        raise ProgramError(f"{where}: no sample lies between {low:g} and {high:g} s; the record {span}")
    return part


def between(track: Track, low_s: float, high_s: float) -> Track:
    """Return the samples between two times, both included; all samples if neither time is finite."""
    if math.isinf(low_s) and math.isinf(high_s):
        return track
    keep = (track.t >= low_s) & (track.t <= high_s)
    velocity = None if track.velocity is None else track.velocity[keep]
    return replace(track, t=track.t[keep], y=track.y[keep], flags=track.flags[keep], velocity=velocity)


MOTION_SENSOR = "motion-sensor"  # family that assumes a fixed speed of sound
LINE_PROTOCOL = "line-protocol"  # family that sends echo times
COMPARED = {"rate_error_ppm", "u_rate_error_ppm", "span_s", "held_readings", "longest_stall_s"}  # of two clocks


def to_track(
    samples: Block, info: SourceInfo, *, recorded_format: str = "", provenance: Mapping[str, Any] | None = None
) -> Track:
    """Return samples as a track for the pipeline.

    The noise stated by a source is passed on. The error column of a file is not noise and is passed on separately.
    """
    stated = provenance or {}
    moments = [event["t_s"] for event in stated.get("events", ()) if event.get("kind") == "trigger"]
    return Track(
        t=samples.t,
        y=samples.distance,
        flags=samples.flags,
        rate_hz=info.rate_hz,
        sigma_m=info.sigma_m,
        quantum_m=info.quantum_m,
        stated_error_m=info.stated_error_m,
        clock=info.clock,
        kind=info.kind,
        velocity=samples.velocity,
        quantity=samples.quantity,
        unit=samples.unit,
        trigger_s=float(moments[0]) if moments else None,  # when the bob left its rest position
        **_clock_comparison(samples, info, stated),
        **_scale(recorded_format, stated.get("sensor") or {}),
    )


def _clock_comparison(samples: Block, info: SourceInfo, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the device clock's rate relative to the host's, if both timestamps exist, and its largest rate error."""
    noted = provenance.get("decoding", {}).get("clock", {})
    if info.clock != "device":
        return {}
    if noted.keys() >= COMPARED:
        comparison = noted  # by the pings, whose times are in no sample; files of earlier versions may lack it
    elif samples.host_ns is not None and (samples.host_ns >= 0).all():
        comparison = fit_clock(samples.t, samples.host_ns).to_mapping()
    else:
        return {}
    clock = {
        "clock_limit": 1e-6 * noted.get("limit_ppm", RESONATOR_PPM),
        "held_samples": comparison["held_readings"],
        "longest_stall_s": comparison["longest_stall_s"],
    }
    if comparison["rate_error_ppm"] is None or comparison["u_rate_error_ppm"] is None:
        return clock
    rate, u_rate = comparison["rate_error_ppm"] * 1e-6, comparison["u_rate_error_ppm"] * 1e-6
    return {**clock, "rate_error": rate, "u_rate_error": u_rate, "compared_s": comparison["span_s"]}


def _scale(recorded_format: str, sensor: Mapping[str, Any]) -> dict[str, Any]:
    """Return how distances were calculated: the speed of sound, if it is known, and the calibration's uncertainties."""
    if recorded_format == MOTION_SENSOR:
        return {"speed_of_sound_m_per_s": SPEED_OF_SOUND_M_PER_S}
    if not sensor:
        return {}
    calibration = Calibration.from_mapping(sensor.get("calibration", {}))
    known = {"sonic": True, "u_scale": calibration.u_scale, "u_offset_m": calibration.u_offset_m}
    # Families that send distances instead of echo times have applied an unknown speed of sound.
    if sensor.get("family") == LINE_PROTOCOL or sensor.get("options", {}).get("unit") == "us":
        known["speed_of_sound_m_per_s"] = calibration.speed_of_sound_m_per_s
    return known
