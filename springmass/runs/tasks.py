"""Recordings to analyse one after the other: a task for each, and its analysed run or the reason why there is none."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

from acquisition.errors import AcquisitionError, NeedsAnswer
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError
from springmass.errors import INTERNAL, NO_MEMORY, UNREADABLE, Error, ProgramError, internal_error
from springmass.loading.options import ANALYSIS_DEFAULTS, AnalysisOptions
from springmass.loading.scenes import Amendments, amended
from springmass.runs.run import Run
from storage.errors import StorageError

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class Task:
    """A recording to analyse, under a name: its path, arrays or a run; ``values`` replace those of its scene."""

    source: Any
    name: str
    scene: Scene | None = None
    how: AnalysisOptions = ANALYSIS_DEFAULTS
    values: Amendments = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Failed:
    """A recording that gives no run: why, and the question that it leaves open."""

    task: Task
    error: ProgramError
    question: NeedsAnswer | None = None


def analyse_all(tasks: Iterable[Task]) -> Iterator[Run | Failed]:
    """Yield the analysed run of each recording, or why there is none; a failure does not stop the others."""
    for task in tasks:
        yield attempted(task, partial(_analysed, task))


def _analysed(task: Task) -> Run:
    run = Run.of(task.source, task.scene, task.how, task.name)
    if task.values:
        run = replace(run, stated=amended(run.scene, task.values))
    _ = run.analysis
    return run


def attempted(task: Task, make: Callable[[], Made]) -> Made | Failed:
    """Return what is made of a recording, or why it cannot be made."""
    where = task.source if isinstance(task.source, str | os.PathLike) else task.name or type(task.source).__name__
    try:
        return make()
    except ProgramError as error:
        return Failed(task, error)
    except (AcquisitionError, StorageError) as error:
        question = error if isinstance(error, NeedsAnswer) else None
        return Failed(task, _unreadable(error, error.where), question)
    except PipelineError as error:
        return Failed(task, _unreadable(error, f"{where}: "))
    except OSError as error:
        return Failed(task, ProgramError(f"{where}: {error}", exit_code=UNREADABLE))
    except MemoryError:
        return Failed(task, ProgramError(f"{where}: {NO_MEMORY}", exit_code=UNREADABLE))
    except Exception as error:  # a defect that one recording meets must not keep the others from their results
        return Failed(task, ProgramError(f"{where}: {internal_error(error)}", exit_code=INTERNAL))


def _unreadable(error: Error, where: str) -> ProgramError:
    return ProgramError(error.problem, error.remedy, where=where, exit_code=UNREADABLE)


def analysed_runs(tasks: Iterable[Task]) -> list[Run]:
    """Return the analysed run of each recording; the first failure is an error."""
    runs = []
    for outcome in analyse_all(tasks):
        if isinstance(outcome, Failed):
            raise outcome.question or outcome.error
        runs.append(outcome)
    return runs


def law_lines(runs: Iterable[Run]) -> list[str]:
    """Return a line for each damping law that a scene states, unless an option set another."""
    laws = [run.scene.damping_law for run in runs if run.how.law in (None, run.scene.damping_law)]
    return [f"damping law {law}: stated in the scene" for law in dict.fromkeys(filter(None, laws))]
