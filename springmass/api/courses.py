"""Courses of many runs for scripts: analysed here, or read from the folder that ``springmass batch`` made."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

from springmass.api.analysing import AnalysisKeywords, AnyScene
from springmass.api.questions import for_python
from springmass.course.results_csv import NUMERIC_COLUMNS, WHOLE, columns_of, read_results
from springmass.course.worker import row_of
from springmass.loading.options import AnalysisOptions
from springmass.loading.scenes import scene_from
from springmass.runs.run import Run
from springmass.runs.tasks import Task, analyse_all

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.bench.scene import Scene
    from springmass.api.analysing import AnySource


def batch(
    sources: Iterable[AnySource],
    scene: AnyScene | None = None,
    *,
    executor: Executor | None = None,
    **how: Unpack[AnalysisKeywords],
) -> pd.DataFrame:
    """Analyse many runs into one table.

    Parameters
    ----------
    sources : iterable
        Sources that :func:`springmass.analyse` takes.
    scene : optional
        As for :func:`springmass.analyse`: one for all runs; default: each run's own scene.
    executor : concurrent.futures.Executor, optional
        Where to work: a ``ProcessPoolExecutor``, or ``dask.distributed.Client(...).get_executor()``; default: here.
    **how
        Keyword arguments of :func:`springmass.analyse`.

    Returns
    -------
    pandas.DataFrame
        One row per run in the order of the sources, with the columns of :func:`springmass.results` that some run has.
        A run that cannot be analysed has its reason in the column ``error``.

    Examples
    --------
    >>> from springmass import sample_data
    >>> frame = batch(sample_data() / f"{name}_simulated_position.txt" for name in ("damped", "undamped"))
    >>> [round(period, 4) for period in frame["period"]]
    [0.7901, 0.7585]
    """
    work = partial(_row, scene=scene_from(scene), how=AnalysisOptions.of(how))
    rows = list((map if executor is None else executor.map)(work, sources))
    frame = _frame(rows, ())
    return frame.loc[:, frame.notna().any() | (frame.columns == "error")]


def _row(source: Any, *, scene: Scene | None, how: AnalysisOptions) -> dict[str, Any]:
    path = os.fspath(source) if isinstance(source, str | os.PathLike) else str(getattr(source, "name", None) or "")
    row: dict[str, Any] = {"run": os.path.basename(path), "path": path, "status": "failed", "error": ""}
    (run,) = analyse_all([Task(source, path, scene, how)])
    if isinstance(run, Run):
        return row | row_of(run, path)
    message = str(run.error)
    if (asked := run.question) is not None:
        message = str(asked.with_remedy(for_python(asked.question, "springmass.analyse", how.given())))
    return row | {"error": " ".join(message.split())}


def results(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Return the table that ``springmass batch`` made, with one row per run.

    Parameters
    ----------
    folder : path
        The folder of results.

    Returns
    -------
    pandas.DataFrame
        Columns as in the reference of a course's results: NAME and NAME_u in SI units, NaN where a run has no value.

    Raises
    ------
    springmass.Error
        If the folder contains no course, or its table is damaged.
    """
    return _frame(*read_results(folder))


def _frame(rows: Sequence[dict[str, Any]], tags: Sequence[str]) -> pd.DataFrame:
    import pandas as pd

    frame = pd.DataFrame(rows, columns=columns_of(tags))
    return frame.astype(
        {name: "float64" if name in NUMERIC_COLUMNS else "Int64" for name in (*NUMERIC_COLUMNS, *WHOLE)}
    )
