"""What scripts call: load, analyse and compare runs of every kind of source."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from types import EllipsisType
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, TypedDict, Unpack

from numpy.typing import ArrayLike

from acquisition.errors import NeedsAnswer
from pipeline.bench.scene import Scene
from pipeline.damping.laws import Law
from pipeline.errors import AnalysisError
from springmass.api.questions import for_python
from springmass.comparing.comparison import SpringComparison, compare_runs
from springmass.loading.options import Accuracy, AnalysisOptions
from springmass.result.output_names import distinct_names
from springmass.runs.run import Run

AnyScene: TypeAlias = Scene | str | os.PathLike[str] | Mapping[str, Any]

if TYPE_CHECKING:
    import xarray as xr

    class Indexed(Protocol):
        """A frame or a series of pandas."""

        @property
        def index(self) -> Any:
            """Times, or numbers of rows."""

    Path: TypeAlias = str | os.PathLike[str]
    Arrays: TypeAlias = tuple[ArrayLike, ArrayLike] | Mapping[str, ArrayLike] | xr.Dataset | xr.DataArray | Indexed
    AnySource: TypeAlias = Path | Run | Arrays


class ReadKeywords(TypedDict, total=False):
    """How a recording is read: the fields of :class:`springmass.loading.options.LoadOptions` for checkers of types."""

    velocity: str | os.PathLike[str] | None
    channel: str | None
    run: str | None
    rate_hz: float | None
    unit: str | None
    time: str | None
    time_unit: str | None
    delimiter: str | None
    decimal: str | None
    unverified: bool


class AnalysisKeywords(ReadKeywords, total=False):
    """How a recording is read and analysed."""

    from_s: float | None
    to_s: float | None
    clock_ppm: float | None
    accuracy: Accuracy
    law: str | Law | None
    laws: Sequence[str | Law | EllipsisType] | None
    method: Literal["classic"] | None


def analyse(source: AnySource, scene: AnyScene | None = None, **how: Unpack[AnalysisKeywords]) -> Run:
    """Analyse a run.

    Parameters
    ----------
    source : path, Run, Dataset, DataArray, DataFrame, Series, mapping or pair of arrays
        The path of a recording, run file or wire log, a run of :func:`springmass.load`, or arrays. A dataset, a frame
        or a mapping has ``"time"`` (s), ``"distance"`` (m) and optionally ``"quality"``; one that xarray read from a
        run file is taken with all that the file states. The values of a data array or a series are distances, and its
        ``time`` or its index gives the times. A pair is ``(t, y)``. NaN marks missing values. Units that a coordinate,
        a heading such as "Distance (cm)" or a quantity of pint states are converted.
    scene : Scene, path or mapping, optional
        Known values of the bench. Default for ``NAME.h5``: the ``[scene]`` of ``NAME.about.toml`` beside it, else the
        scene inside the run file, else nothing.
    **how
        ``accuracy``: "fast", "standard" (default) or "best". ``law``: the damping law, if it is known, a name of
        :data:`springmass.LAWS` or a law of :func:`springmass.make_law`; "any" lets the run choose, regardless of the
        scene. ``laws``: the laws to try, with ``...`` for all built-in ones. ``from_s`` and ``to_s``: limits of the
        part to use, s. ``unit`` and ``time_unit``: those of arrays or of a file that states none. Further options of
        reading a file: velocity, channel, rate_hz, run, time, delimiter, decimal, clock_ppm, unverified.

    Raises
    ------
    springmass.Error
        If the source or the scene cannot be read, something that it leaves out was not given, or fewer than eight
        samples are usable; ``remedy`` says what to do.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(1000) / 100
    >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
    >>> analyse((t, y), laws=["none", "linear"])["period"]
    0.757010(22) s
    """
    run = _run(source, scene, "springmass.analyse", how)
    _ = run.analysis  # here, and not where a result is first asked for
    return run


def load(source: AnySource, scene: AnyScene | None = None, **how: Unpack[AnalysisKeywords]) -> Run:
    """Read a recording, a run file or a wire log; it is analysed when a result is asked for.

    All digests of a run file are checked before a sample is used.

    Parameters
    ----------
    source, scene, **how
        As for :func:`springmass.analyse`.

    Raises
    ------
    springmass.Error
        If the source cannot be read, or something that it leaves out was not given; ``remedy`` says what to do.
    """
    return _run(source, scene, "springmass.load", how)


def _run(source: Any, scene: Any, function: str, options: Mapping[str, Any]) -> Run:
    """Return the run of a source; an error about something missing names the arguments of the called function."""
    how = AnalysisOptions.of(options)
    try:
        return Run.of(source, scene, how)
    except NeedsAnswer as error:
        raise error.with_remedy(for_python(error.question, function, how.given())) from None


def compare(
    sources: Sequence[AnySource],
    scene: AnyScene | Sequence[AnyScene | None] | None = None,
    *,
    mass_correlation: float = 0.0,
    reported: Path | None = None,
    hooke: Path | None = None,
    **how: Unpack[AnalysisKeywords],
) -> SpringComparison:
    """Test whether runs agree on one spring constant, and whether one damping law fits all runs of one bob.

    Parameters
    ----------
    sources : sequence
        At least two runs, or sources that :func:`analyse` takes.
    scene : optional
        As for :func:`analyse`: one for all runs, or a list with one for each; default: each run's own scene.
    mass_correlation : float
        Correlation between the errors of two bobs' masses, 0 to 1.
    reported : path, optional
        A table with the columns run, name, value, u and unit: printed values whose mistakes are among the findings.
    hooke : path, optional
        A table of masses and rest positions, for a spring constant by Hooke's law.
    **how
        Keyword arguments of :func:`analyse`.

    Raises
    ------
    springmass.Error
        If fewer than two runs are given, one does not oscillate, a scene gives no bob mass, the scenes state
        different springs, or a table cannot be read.
    """
    if len(sources) < 2:
        raise AnalysisError(f"compare needs two runs at least, got {len(sources)}")
    scenes = list(scene) if isinstance(scene, list | tuple) else [scene] * len(sources)
    if len(scenes) != len(sources):
        raise AnalysisError(f"expected one scene for all runs or one for each, got {len(scenes)} for {len(sources)}")
    each = [
        source
        if isinstance(source, Run) and its_scene is None and not how
        else _run(source, its_scene, "springmass.compare", how)
        for source, its_scene in zip(sources, scenes, strict=True)
    ]
    names = distinct_names([run.name or "run" for run in each])
    named = [run.named(name) for run, name in zip(each, names, strict=True)]
    return compare_runs(named, mass_correlation=mass_correlation, reported=reported, static=hooke)
