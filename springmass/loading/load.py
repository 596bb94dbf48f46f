"""Load a recording, a run file or a wire log, with everything that its reader noticed."""

import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.decoders.registry import get_family
from acquisition.errors import FormatError, NeedsAnswer, SensorError
from acquisition.live.clock_fit import facts_of
from acquisition.live.line_times import settled
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.recording import FormatIssue, Recording
from springmass.errors import LOG, UNREADABLE, ProgramError
from springmass.layout import STDIN, part
from springmass.loading.inputs import kind_of
from springmass.loading.loaded import UNVERIFIED, Loaded, sha256_of
from springmass.loading.notes import about_of, answers_of
from springmass.loading.options import LOAD_DEFAULTS, LoadOptions
from storage.errors import RunDamaged
from storage.recovery.recover import open_log, read_longest_part
from storage.run_file.layout import CHECKED
from storage.run_file.reading import open_run

DIFFERENCES_NAMED = 5  # maximum number of differences that a message names


def load(path: str | Path, options: LoadOptions = LOAD_DEFAULTS, *, scene_given: bool = False) -> Loaded:
    """Read a recording, a run file or a wire log, or standard input.

    All digests of a run file are checked before any sample is used. With ``scene_given`` the caller uses another scene,
    and none is said to be read from the notes. NeedsAnswer says what the file leaves open and the options do not give.
    """
    if str(path) == STDIN:
        return _load_stdin(options)
    where = Path(path)
    kind, kept = kind_of(where), answers_of(where)
    from_notes = kept.beside(options.about_the_file().given())
    options = replace(options, **from_notes)
    about = about_of(where)
    noted = [f"{name} {value}" for name, value in from_notes.items()]
    noted += filter(None, [about.described(scene=not scene_given)])
    if from_notes:  # said first, because they may be the reason why the file cannot be read
        LOG.info(f"{kept.path}: {', '.join(noted)} read from the notes next to the file")
    if kind == "run":
        _refuse(where, "a run file", options, ())
        loaded = _load_run(where, unverified=options.unverified)
    elif kind == "wire":
        _refuse(where, "a wire log", options, ("channel",))
        loaded = _load_wire(where, options.channel)
    else:
        recording = open_recording(where, options.about_the_file())
        origin = {"start_time": recording.start_time, "recorded_run": recording.run}
        provenance = {name: value for name, value in origin.items() if value}
        sha256 = recording.originals[0].sha256
        loaded = Loaded(recording, recording.format, provenance=provenance, sha256=sha256)
    for trap in loaded.traps:
        if trap.code == UNVERIFIED:
            LOG.warning(f"{where}: {trap.message}")
    if from_notes and kept.sha256 not in ("", loaded.sha256):
        LOG.warning(f"{kept.path}: {where.name} has changed since it was stated how to read it; check [reading]")
    if noted and not from_notes:
        LOG.info(f"{about.path}: {', '.join(noted)} read from the notes next to the file")
    if about.described():
        scene = loaded.scene if about.scene is None else about.scene.to_mapping()
        marks = [*loaded.provenance.get("marks", ()), *({"t_s": t_s, "text": text} for t_s, text in about.marks)]
        added = {"marks": marks} if marks else {}
        if about.notes:
            added["notes"] = list(about.notes)
        loaded = replace(loaded, scene=scene, provenance={**loaded.provenance, **added})
    summary = f"{loaded.format}, {len(loaded.samples)} samples of {loaded.samples.quantity}"
    LOG.debug(f"read: {where}: {summary} at {loaded.info.rate_hz:g} Hz, clock: {loaded.info.clock}")
    return replace(loaded, reading=options.about_the_file().given())


def _load_stdin(options: LoadOptions) -> Loaded:
    """Load from standard input by way of a temporary file, because the formats need a seekable file."""
    with tempfile.TemporaryDirectory(prefix="springmass-") as folder:
        spooled = Path(folder) / "stdin"
        if sys.stdin is None:
            raise ProgramError("standard input is closed", "name a file", UNREADABLE)
        with open(spooled, "wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        try:
            loaded = load(spooled, options)
        except NeedsAnswer as error:
            raise NeedsAnswer(replace(error.question, path=STDIN), line=error.line) from None
        except FormatError as error:
            raise type(error)(STDIN, error.problem, error.remedy, line=error.line) from None
        originals = loaded.originals  # read while the file exists
    recording = replace(loaded.recording, path=STDIN, originals=originals)
    return replace(loaded, recording=recording, originals_inside=False)


def sample_data() -> Path:
    """Return the folder of the bundled recordings."""
    folder = part("sample_data")
    if (folder / "undamped_simulated_position.txt").is_file():
        return folder
    raise ProgramError(f"{folder}: the bundled recordings are missing", "install springmass again", UNREADABLE)


def _refuse(path: Path, what: str, options: LoadOptions, allowed: Sequence[str]) -> None:
    """Refuse options that describe a file which already states everything itself."""
    given = [name for name in options.about_the_file().given() if name not in allowed]
    if given:
        raise ProgramError(f"{path}: {what} states everything, got {', '.join(given)} too", "leave that out")


def _load_run(path: Path, *, unverified: bool) -> Loaded:
    sha256 = sha256_of(path)
    with open_run(path, unverified=unverified) as run:
        try:
            recording = run.recording()
            if unverified:
                issues = _unverified(path, run.differences())
                recording = replace(recording, traps=(*recording.traps, *issues))
            else:
                run.verify(but=CHECKED)
        except RunDamaged as error:
            if unverified:
                raise
            remedy = f"{error.remedy}, or look at it as it is with --unverified (--read unverified=yes)"
            raise RunDamaged(path, error.problem, remedy) from error
        recording, provenance = _with_line_times(recording, run.provenance)
        return Loaded(recording, "run", run.header.scene, provenance, sha256, originals_inside=True)


def _with_line_times(recording: Recording, provenance: Mapping[str, Any]) -> tuple[Recording, Mapping[str, Any]]:
    """Return a run with better times if it is older than these, and its lines had only the times of their arrival."""
    decoding = provenance.get("decoding", {})
    clock = decoding.get("clock", {})
    if recording.format != "wire" or recording.info.clock != "host" or "lines" in clock:
        return recording, provenance
    try:
        polled = get_family(provenance.get("sensor", {}).get("family", "")).poll is not None
    except SensorError:  # of a package that is not installed
        return recording, provenance
    if polled:
        return recording, provenance
    samples, lines = settled(recording.samples)
    decoding = {**decoding, "clock": {**clock, "lines": facts_of(lines)}}
    recording = replace(recording, samples=samples, info=lines.described(recording.info))
    return recording, {**provenance, "decoding": decoding}


def _unverified(path: Path, differing: Sequence[RunDamaged]) -> tuple[FormatIssue, ...]:
    """Return a trap that names the parts of a run file with a checksum mismatch."""
    if not differing:
        return ()
    named = "; ".join(error.problem for error in differing[:DIFFERENCES_NAMED])
    more = f"; and {len(differing) - DIFFERENCES_NAMED} more" if len(differing) > DIFFERENCES_NAMED else ""
    message = f"{path.name} was changed or damaged after it was written ({named}{more}); it was read, as you asked."
    return (FormatIssue(UNVERIFIED, message, len(differing)),)


def _load_wire(path: Path, channel: str | None) -> Loaded:
    """Decode the longest part of a sensor's data; the log is not changed, and may still be written."""
    contents, survey = open_log(path)
    ports = {str(sensor.channel): sensor.port for sensor in survey.header.sensors}
    wanted = [number for number, port in ports.items() if channel in (None, number, port)]
    if len(wanted) != 1:
        sensors = ", ".join(f"{number} at {port}" for number, port in ports.items())
        refused = "" if channel is None else f'channel "{channel}" is not in the log, '
        need = MissingItem(Missing.CHANNEL, tuple(ports), next(iter(ports)))
        raise NeedsAnswer(Question(str(path), (need,), reason=f"{refused}the log holds the sensors {sensors}"))
    recording, provenance, number, count = read_longest_part(contents, survey, int(wanted[0]))
    if count > 1:
        LOG.info(f"{path}: the sensor came back; this is its longest part, number {number}")
    return Loaded(recording, "wire", survey.header.scene, provenance, recording.originals[0].sha256)
