"""From a loaded input to its analysis and result: the steps that several commands share."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pipeline.accuracy import params_for
from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.results.classic import Classic, classic
from springmass import __version__
from springmass.errors import USAGE, ProgramError, detail
from springmass.runs.json_results import result_of
from springmass.runs.loading import Loaded
from springmass.runs.scenes import stated_keys

__all__ = [
    "Analysed",
    "analyse_loaded",
    "distinct_names",
    "in_a_name",
    "made_now",
    "make_folder",
    "now_utc",
    "scene_of",
]


@dataclass(frozen=True, slots=True, eq=False)
class Analysed:
    """One input with everything that was made of it, ready for a report.

    Parameters
    ----------
    name : str
    analysis : Analysis
    result : mapping
        As printed under ``--json``. A report shows its ``input`` as it is, and with it ``title``, the recording's own
        first line, if it has one.
    classic : Classic, optional
        The lab report's own method on the same input, to be set beside.
    recorded : mapping
        What the recording says of its origin: start time, marks, events, calibration.
    """

    name: str
    analysis: Analysis
    result: Mapping[str, Any]
    classic: Classic | None = None
    recorded: Mapping[str, Any] = field(default_factory=dict)


def analyse_loaded(
    loaded: Loaded,
    scene: Scene | None,
    *,
    parameters: Mapping[str, Any],
    name: str = "",
    accuracy: str = "standard",
    with_classic: bool = False,
    time_utc: str | None = None,
) -> Analysed:
    """Analyse one input.

    Parameters
    ----------
    loaded : Loaded
    scene : Scene or None
        None: the scene that a run file carries, if any.
    parameters : mapping
        Options as resolved, stored with the result.
    name : str
        Left out, the file's.
    accuracy : {"fast", "standard", "best"}
        Tier.
    with_classic : bool
        Whether the report's method is wanted; its estimates then stand in the result.
    time_utc : str, optional
        ISO 8601; left out, now.

    Raises
    ------
    pipeline.errors.AnalysisError, pipeline.errors.SceneError
    """
    scene = scene_of(loaded, scene)
    analysis = analyse(loaded.track, scene, params_for(accuracy))
    detail(f"analysed: {loaded.path} at {accuracy}, with a scene that states {stated_keys(scene)}")
    by_classic = classic(loaded.track, scene) if with_classic else None
    result = result_of(
        loaded,
        analysis,
        time_utc=time_utc or now_utc(),
        accuracy="classic" if with_classic else accuracy,
        parameters={**parameters, "scene": scene.to_mapping()},
        classic=by_classic,
    )
    return Analysed(name or loaded.path.name, analysis, result, by_classic, loaded.provenance)


def scene_of(loaded: Loaded, given: Scene | None) -> Scene:
    """Return the scene that was given for an input, else the one that it carries."""
    return given or Scene.from_mapping(loaded.scene or {}, where=f"{loaded.path} (its scene)")


def distinct_names(paths: Sequence[str]) -> list[str]:
    """Return a name for each input: its file's without the suffix, later ones of one name numbered.

    Examples
    --------
    >>> distinct_names(["a/bob.txt", "b/bob.txt", "disc.h5"])
    ['bob', 'bob-2', 'disc']
    """
    return numbered([Path(path).stem for path in paths])


def numbered(stems: Iterable[str]) -> list[str]:
    """Return names in their order, later ones of one name numbered."""
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
    """Return a name with a suffix added, cut where both together are longer than the 255 bytes that a name may have.

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
    digest = hashlib.sha256(whole).hexdigest()[:8]  # names that are alike up to there stay apart
    return f"{whole[: LONGEST_NAME - len(suffix) - 9].decode(errors='ignore')}-{digest}{suffix}"


LONGEST_NAME = 255


def make_folder(path: str | Path) -> Path:
    """Return a folder for results, made where it is not there yet.

    Raises
    ------
    ProgramError
        With exit code 2 if it cannot be.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProgramError(
            f"{folder}: a folder for results was demanded, {error.strerror}; name another with --out", USAGE
        ) from error
    return folder


def made_now() -> dict[str, str]:
    """Return what a run file says of its making: program, version and time."""
    return {"software": "springmass", "version": __version__, "created_utc": now_utc()}


def now_utc() -> str:
    """Return the time as ISO 8601 in UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
