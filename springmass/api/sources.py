"""Analysis of every kind of input: paths, open runs, datasets, frames, arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import EllipsisType
from typing import TYPE_CHECKING, Any

from acquisition.errors import NeedsAnswer
from pipeline.analyse import Analysis as Found
from pipeline.bench.scene import Scene
from pipeline.damping.laws import LAWS, Law, find_law
from pipeline.errors import AnalysisError, TrackError
from pipeline.options import Options, options_for
from springmass.api.analysis import Analysis
from springmass.api.arrays import track_of
from springmass.api.frames import comparison_frame
from springmass.runs.analysing import Analysed, analyse_loaded, analyse_track, distinct_names, with_law
from springmass.runs.comparing import Compared, compare_analysed, demand_one_spring
from springmass.runs.loading import Loaded, cut
from springmass.runs.loading import load as read
from springmass.runs.options import ReadOptions
from springmass.runs.questions import for_python
from springmass.runs.scenes import read_scene
from springmass.values import ANY_LAW
from storage.run_file.reading import Run

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Comparison", "analyse", "compare", "load"]


def analyse(
    source: Any,
    scene: Scene | str | os.PathLike[str] | Mapping[str, Any] | None = None,
    options: Options | None = None,
    *,
    accuracy: str | None = None,
    law: str | Law | None = None,
    laws: Sequence[str | Law | EllipsisType] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    **completions: Any,
) -> Analysis:
    """Analyse a run.

    Parameters
    ----------
    source : path, Run, Loaded, Track, Dataset, DataArray, DataFrame, Series, mapping or pair of arrays
        The path of a recording, run file or wire log, or a result of :func:`springmass.open_run` or
        :func:`springmass.load`; these include clock, calibration and scene. A dataset, a frame or a mapping has
        ``"time"`` (s), ``"distance"`` (m) and optionally ``"quality"``. The values of a data array or a series are
        distances, and its ``time`` or its index gives the times. A pair is ``(t, y)``. NaN marks missing values. Units
        that a coordinate, a heading such as "Distance (cm)" or a quantity of pint states are converted.
    scene : Scene, path or mapping, optional
        Known values of the bench. Default for ``NAME.h5``: the ``[scene]`` of ``NAME.about.toml`` beside it, else the
        scene inside the run file, else nothing.
    options : springmass.Options, optional
        Options of the analysis, instead of those of a tier.
    accuracy : {"fast", "standard", "best"}, optional
        Tier; default: "standard". It cannot be combined with ``options``.
    law : str or Law, optional
        The damping law, if it is known: a name of :data:`springmass.LAWS` or a law of :func:`springmass.make_law`. The
        results are based on it alone, and findings report whether the run contradicts it. "any" lets the run choose,
        regardless of the scene. Default: the law of the scene.
    laws : sequence of str or Law, optional
        The damping laws to try: names of :data:`springmass.LAWS`, laws of :func:`springmass.make_law`, and ``...`` for
        all built-in laws.
    from_s, to_s : float, optional
        Limits of the time range to use, s; default: the whole run.
    **completions
        ``unit`` and ``time_unit`` of arrays, or options for reading a recording, as :func:`springmass.load` takes
        them: velocity, channel, rate_hz, unit, run,
        time, time_unit, clock_ppm, unverified.

    Returns
    -------
    Analysis

    Raises
    ------
    AnalysisError
        If fewer than eight samples are usable, or a law or an option is unknown.
    TrackError
        If the arrays do not form a track.
    acquisition.errors.NeedsAnswer
        If the file lacks information that was not given. The error's ``question`` lists what is missing and every
        answer.
    acquisition.errors.FormatError, storage.errors.StorageError, springmass.errors.ProgramError
        If a file or a scene cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(1000) / 100
    >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
    >>> analyse((t, y), laws=["none", "linear"])["period"]
    0.757010(22) s
    """
    if options is not None and accuracy is not None:
        raise AnalysisError("options replace those of an accuracy: give one of the two")
    chosen = options or options_for(accuracy or "standard")
    if laws is not None:
        chosen = replace(chosen, laws=_laws(laws))
    if law is not None:
        chosen = with_law(chosen, law if law == ANY_LAW else find_law(law))
    if isinstance(source, Run):
        source = source.path
    if isinstance(source, str | os.PathLike):
        source = load_file(source, "springmass.analyse", {**completions, "from_s": from_s, "to_s": to_s})
    elif others := completions.keys() - {"unit", "time_unit"} or (completions if isinstance(source, Loaded) else ()):
        raise TrackError(f"{', '.join(others)} complete recordings named by a path, got a {type(source).__name__}")
    elif isinstance(source, Loaded):
        source = replace(source, track=cut(source.track, from_s, to_s, where=source.path))
    if isinstance(source, Loaded):
        found, name = analyse_loaded(source, _scene(scene), options=chosen).analysis, source.path.name
    else:
        track = cut(track_of(source, **completions), from_s, to_s, where="the record")
        found, name = analyse_track(track, _scene(scene) or Scene(), chosen), ""
    return Analysis(**{each.name: getattr(found, each.name) for each in fields(Found)}, name=name)


def load(path: str | os.PathLike[str], **options: Any) -> Loaded:
    """Read a recording, a run file or a wire log.

    All digests of a run file are checked before a sample is used.

    Parameters
    ----------
    path : path
    **options
        The fields of :class:`springmass.runs.options.ReadOptions`: information that the file may lack (velocity,
        channel, run, rate_hz, unit, time, time_unit), and from_s, to_s, clock_ppm, unverified.

    Raises
    ------
    acquisition.errors.NeedsAnswer
        If the file lacks information that was not given. The error's ``question`` lists what is missing and every
        answer.
    acquisition.errors.FormatError, storage.errors.StorageError
        If the file cannot be read; the message is one line.
    ProgramError
        If no sample lies between ``from_s`` and ``to_s``.
    TypeError
        If an option is unknown.
    """
    return load_file(path, "springmass.load", options)


def load_file(path: str | os.PathLike[str], function: str, options: Mapping[str, Any]) -> Loaded:
    """Load a file; an error about missing information names the arguments of the called function."""
    given = ReadOptions.of(options)
    try:
        return read(Path(path), given)
    except NeedsAnswer as error:
        raise error.with_remedy(for_python(error.question, function, given.given())) from None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison(Compared):
    """The joint result of several runs of one spring, as :func:`springmass.compare` returns it.

    Parameters
    ----------
    runs : mapping of str to Analysis
    """

    runs: Mapping[str, Analysis]

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row per run, and a row "together" for their mean.

        Returns
        -------
        pandas.DataFrame
            A frame with the columns period and u_period (s), spring_constant, u and u_own (N/m), pull and agree; the
            mean is NaN where the runs disagree.
        """
        return comparison_frame(self.comparison, {name: run["period"] for name, run in self.runs.items()})

    def __repr__(self) -> str:
        return "\n".join([self.comparison.message, *(one.message for one in self.joint)])


def compare(
    sources: Sequence[Any],
    scene: Any = None,
    *,
    mass_correlation: float = 0.0,
    **how: Any,
) -> Comparison:
    """Test whether runs agree on one spring constant, and whether one damping law fits all runs of one bob.

    Parameters
    ----------
    sources : sequence
        At least two analyses, or sources that :func:`analyse` takes.
    scene : optional
        As for :func:`analyse`: one for all runs, or a list with one for each; default: each run's own scene.
    mass_correlation : float
        Correlation between the errors of two bobs' masses, 0 to 1.
    **how
        Keyword arguments of :func:`analyse`.

    Raises
    ------
    AnalysisError
        If fewer than two runs are given, or one does not oscillate.
    springmass.errors.ProgramError
        If a scene gives no bob mass, or the scenes state different springs.
    """
    if len(sources) < 2:
        raise AnalysisError(f"compare needs two runs at least, got {len(sources)}")
    scenes = list(scene) if isinstance(scene, list | tuple) else [scene] * len(sources)
    if len(scenes) != len(sources):
        raise AnalysisError(f"expected one scene for all runs or one for each, got {len(scenes)} for {len(sources)}")
    each = [
        one if isinstance(one, Analysis) else analyse(one, its, **how) for one, its in zip(sources, scenes, strict=True)
    ]
    runs = dict(zip(distinct_names([one.name or "run" for one in each]), each, strict=True))
    demand_one_spring([(name, run.scene) for name, run in runs.items()])
    found = compare_analysed([Analysed(name, run, {}) for name, run in runs.items()], mass_correlation=mass_correlation)
    return Comparison(found.comparison, found.joint, found.findings, runs)


def _laws(wanted: Sequence[str | Law | EllipsisType]) -> tuple[str | Law, ...]:
    """Return the requested laws, with ``...`` replaced by all built-in laws that are not named."""
    if isinstance(wanted, str):
        raise AnalysisError(f"laws must be a list of names and laws, got the text {wanted!r}")
    named = [law for law in wanted if not isinstance(law, EllipsisType)]
    for law in named:
        find_law(law)
    others = [name for name in LAWS if name not in named]
    found: list[Any] = []
    for each in wanted:
        found += others if isinstance(each, EllipsisType) else [each]
    return tuple(found)


def _scene(given: Any) -> Scene | None:
    """Return the given scene as a ``Scene``, or None if none was given."""
    if given is None or isinstance(given, Scene):
        return given
    return Scene.from_mapping(given) if isinstance(given, Mapping) else read_scene(given)
