"""Turn a loaded input into its analysis and result: the steps that several commands share."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition.recordings.recording import Trap
from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.damping.laws.law import Law
from pipeline.options import Options, options_for
from pipeline.results.classic import Classic, classic
from pipeline.track import Track
from springmass import __version__
from springmass.errors import USAGE, ProgramError, detail
from springmass.runs.about import about_of
from springmass.runs.json_results import result_of, with_traps
from springmass.runs.loading import Loaded, load
from springmass.runs.options import READ, ReadOptions
from springmass.runs.scenes import Amendments, amended, stated_keys

__all__ = [
    "Analysed",
    "AnalysedRun",
    "analyse_loaded",
    "analyse_track",
    "distinct_names",
    "in_a_name",
    "law_line",
    "load_and_analyse",
    "made_now",
    "make_folder",
    "now_utc",
    "scene_of",
    "with_law",
]

NOTHING: Amendments = {}


@dataclass(frozen=True, slots=True, eq=False)
class Analysed:
    """One input with everything derived from it, ready for a report.

    Parameters
    ----------
    name : str
    analysis : Analysis
    result : mapping
        The result as printed with ``--json``. A report shows its ``input`` unchanged.
    classic : Classic, optional
        The lab report's own method on the same input, for comparison.
    recorded : mapping
        What the recording states about its origin: start time, title, marks, events, calibration.
    """

    name: str
    analysis: Analysis
    result: Mapping[str, Any]
    classic: Classic | None = None
    recorded: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class AnalysedRun:
    """One loaded and analysed recording, with the numbers that every command, page, report and script shows.

    Parameters
    ----------
    loaded : Loaded
    analysis : Analysis
        Its findings include those of the reader.
    accuracy : str
    classic : Classic or None
        The lab report's own method on the same input.
    """

    loaded: Loaded
    analysis: Analysis
    accuracy: str
    classic: Classic | None = None

    def described(self, parameters: Mapping[str, Any], *, name: str = "", time_utc: str | None = None) -> Analysed:
        """Return the analysed run with its JSON, ready for a report.

        Parameters
        ----------
        parameters : mapping
            Resolved options, stored with the result.
        name : str
            Name of the run; if empty, the file's name.
        time_utc : str, optional
            Time of the analysis, ISO 8601; None: now.
        """
        result = result_of(
            self.loaded,
            self.analysis,
            time_utc=time_utc or now_utc(),
            accuracy="classic" if self.classic is not None else self.accuracy,
            parameters={**parameters, "scene": self.analysis.scene.to_mapping()},
            classic=self.classic,
        )
        recorded = {**self.loaded.provenance, "title": self.loaded.title}
        return Analysed(name or self.loaded.path.name, self.analysis, result, self.classic, recorded)


def load_and_analyse(
    path: str | Path,
    reading: ReadOptions = READ,
    scene: Scene | None = None,
    *,
    bench: Amendments = NOTHING,
    accuracy: str = "standard",
    law: str | None = None,
    options: Options | None = None,
    with_classic: bool = False,
) -> AnalysedRun:
    """Read a recording, a run file or a wire log, and analyse it.

    Parameters
    ----------
    path : path
    reading : ReadOptions
    scene : Scene or None
        None: the scene noted next to the file, else the one inside a run file.
    bench : mapping
        Values that replace those of the scene, in the form that :func:`springmass.runs.scenes.amended` takes.
    accuracy : {"fast", "standard", "best"}
        Accuracy tier.
    law : str or None
        Stated damping law, in the form that :func:`with_law` takes.
    options : pipeline.options.Options, optional
        Options of the analysis, used instead of those of the tier.
    with_classic : bool
        Whether to apply the lab report's own method as well.

    Raises
    ------
    acquisition.errors.NeedsAnswer
        If the file leaves something open that the options do not give.
    acquisition.errors.FormatError, storage.errors.StorageError, springmass.errors.ProgramError
        If the file cannot be read, or a value of the bench is impossible.
    pipeline.errors.AnalysisError, pipeline.errors.SceneError
        If the recording cannot be analysed.
    """
    loaded = load(path, reading, scene_given=scene is not None)
    return analyse_loaded(
        loaded, scene, bench=bench, accuracy=accuracy, law=law, options=options, with_classic=with_classic
    )


def analyse_loaded(
    loaded: Loaded,
    scene: Scene | None = None,
    *,
    bench: Amendments = NOTHING,
    accuracy: str = "standard",
    law: str | None = None,
    options: Options | None = None,
    with_classic: bool = False,
) -> AnalysedRun:
    """Analyse an input that is already loaded; see :func:`load_and_analyse`."""
    scene = scene_of(loaded, scene)
    if bench:
        scene = amended(scene, bench, where="the command line")
    analysis = analyse_track(loaded.track, scene, with_law(options or options_for(accuracy), law), loaded.traps)
    detail(f"analysed: {loaded.path} at {accuracy}, with a scene that states {stated_keys(scene)}")
    return AnalysedRun(loaded, analysis, accuracy, classic(loaded.track, scene) if with_classic else None)


def with_law(options: Options, law: str | Law | None) -> Options:
    """Return options with which the results follow one damping law.

    Parameters
    ----------
    options : pipeline.options.Options
    law : str or None
        Name of a law; "any" leaves the choice to the recording, whatever the scene states; None leaves the options as
        they are.
    """
    return options if law is None else replace(options, stated=law)


def law_line(analysis: Analysis, recording: Path, scene_file: str | Path | None) -> str:
    """Return a line naming the damping law that the scene states; empty if it states none, or an option set the law.

    Parameters
    ----------
    analysis : Analysis
    recording : Path
    scene_file : path or None
        Scene file given for the recording; None: the scene is noted next to the recording or stored inside it.
    """
    law = analysis.scene.damping_law
    if law is None or analysis.options.stated != law:
        return ""
    if scene_file is None:
        noted = about_of(recording)
        scene_file = recording if noted.scene is None else noted.path
    return f"damping law {law}: stated in {scene_file}"


def analyse_track(track: Track, scene: Scene, options: Options, traps: Sequence[Trap] = ()) -> Analysis:
    """Analyse samples; the findings include the traps that their reader noticed.

    Parameters
    ----------
    track : Track
    scene : Scene
    options : pipeline.options.Options
    traps : sequence of Trap
        Traps that the reader noticed.
    """
    found = analyse(track, scene, options)
    return replace(found, findings=with_traps(found.findings, traps))


def scene_of(loaded: Loaded, given: Scene | None) -> Scene:
    """Return the scene given for an input, or else the scene that the input carries."""
    return given or Scene.from_mapping(loaded.scene or {}, where=f"{loaded.path} (its scene)")


def distinct_names(paths: Sequence[str]) -> list[str]:
    """Return a name for each input: its file name without the suffix, with repeated names numbered.

    Examples
    --------
    >>> distinct_names(["a/bob.txt", "b/bob.txt", "disc.h5"])
    ['bob', 'bob-2', 'disc']
    """
    return numbered([Path(path).stem for path in paths])


def numbered(stems: Iterable[str]) -> list[str]:
    """Return the names in order, with repeated names numbered."""
    counts: dict[str, int] = {}
    names: dict[str, None] = {}
    for stem in stems:
        count = counts.get(stem, 0) + 1
        while (name := stem if count == 1 else f"{stem}-{count}") in names:
            count += 1
        counts[stem] = count
        names[name] = None
    return list(names)


def in_a_name(name: str, suffix: str) -> str:
    """Return a name with a suffix added, with the name cut if both exceed the 255 bytes that a file name may have.

    Examples
    --------
    >>> in_a_name("bob", ".results")
    'bob.results'
    >>> len(in_a_name("b" * 255, ".results"))
    255
    """
    whole = os.fsencode(name)
    if len(whole) + len(suffix) <= LONGEST_NAME:
        return name + suffix
    digest = hashlib.sha256(whole).hexdigest()[:8]  # keeps names distinct that are identical up to the cut
    return f"{whole[: LONGEST_NAME - len(suffix) - 9].decode(errors='ignore')}-{digest}{suffix}"


LONGEST_NAME = 255


def make_folder(path: str | Path) -> Path:
    """Return a folder for results, created if it does not exist.

    Raises
    ------
    ProgramError
        With exit code 2 if the folder cannot be created.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProgramError(
            f"{folder}: cannot make the folder for results ({error.strerror}); name another with -o", USAGE
        ) from error
    return folder


def made_now() -> dict[str, str]:
    """Return the origin that a run file states: program, version and time of creation."""
    return {"software": "springmass", "version": __version__, "created_utc": now_utc()}


def now_utc() -> str:
    """Return the current time in ISO 8601, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
