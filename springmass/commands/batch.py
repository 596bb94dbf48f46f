"""``springmass batch``: a course of runs to one table, a page and reports, resumable, here or on many machines."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

from springmass.batch.course import template
from springmass.batch.page import PAGE
from springmass.batch.plan import plan
from springmass.batch.results_table import CSV
from springmass.batch.rows import FAILED
from springmass.batch.running import Options, run_pass
from springmass.batch.store import Store
from springmass.commands import completions
from springmass.errors import OK, SOME_FAILED, UNREADABLE, USAGE, ProgramError, complain, suggest, tell
from springmass.runs.analysing import make_folder
from springmass.terminal.printing import visible_lines

__all__ = ["run"]

EVERY_S = 10.0  # between two lines of progress where no terminal shows it


def run(options: argparse.Namespace) -> int:
    """Analyse what is new or has changed, and put all together."""
    answers = {**completions(options), "from_s": options.from_s, "to_s": options.to_s, "clock_ppm": options.clock_ppm}
    if not options.input and options.runs is None:
        raise ProgramError("recordings, folders or --runs FILE were demanded, got none of them", USAGE)
    if options.template:
        jobs = plan(options.input).jobs
        table = template([job.path for job in jobs])
        # A file gets the paths as they are, for they are read from it again.
        print(visible_lines(table) if sys.stdout.isatty() else table.removesuffix("\n"))
        return OK
    if options.output is None:
        raise ProgramError("a folder for the results was demanded; name it with -o DIR", USAGE)
    if options.dask is not None and (options.jobs or options.shard):
        raise ProgramError("--dask has workers of its own; leave out --jobs and --shard", USAGE)
    folder = make_folder(options.output)
    store = Store(folder)
    with store.held("with others" if options.shard else "alone"):
        store.read()
        if store.damaged:
            complain(f"{store.parts}: {store.damaged} lines of parts are damaged; their runs are analysed again")
        course = plan(
            options.input,
            runs_csv=options.runs,
            scene=options.scene,
            accuracy=options.accuracy,
            answers=answers,
            known=store.paths(),
            but={os.path.abspath(folder)},
        )
        for line in course.said:
            tell(line)
        how = Options(
            jobs=options.jobs,
            shard=options.shard,
            dask=options.dask,
            rehash=options.rehash,
            reports=options.reports,
        )
        with _Progress(quiet=options.quiet) as progress:
            outcome = run_pass(course, store, folder, how, told=progress)
    for line in outcome.unwritten:
        complain(line)
    failed = len(outcome.failures)
    tell(f"{outcome.runs} runs: {outcome.kept} unchanged, {outcome.done} analysed, {failed} failed")
    if options.shard is None:
        tell(f"written: {folder / CSV}, {folder / PAGE}")
        suggest(f"open {folder / PAGE} in a browser")
    else:
        suggest("the same command without --shard, when all shards have ended, puts them together")
    if failed and failed == outcome.runs:
        return UNREADABLE
    return SOME_FAILED if failed or outcome.unwritten else OK


class _Progress:
    """Says how far the work is: a bar on a terminal, else a line now and then; failures as they come."""

    def __init__(self, *, quiet: bool) -> None:
        from springmass.terminal.look import watched

        self._bar: Any = None
        self._began = self._told = time.monotonic()
        if not quiet and watched(sys.stderr):
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("runs", total=None)

    def __enter__(self) -> _Progress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, rows: Sequence[Mapping[str, Any]], done: int, total: int) -> None:
        for row in rows:
            if row["status"] in FAILED:
                complain(row["error"])
        now = time.monotonic()
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total)
        elif now - self._told >= EVERY_S and done < total:
            self._told = now
            left = (now - self._began) * (total - done) / done
            tell(f"{done} of {total} runs, {_time(left)} left")


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"
