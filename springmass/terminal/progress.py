"""Show the progress of a long task on stderr: a temporary bar on a terminal, elsewhere optional lines."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from datetime import timedelta
from typing import TYPE_CHECKING, Self, TypeVar

from springmass.errors import tell
from springmass.terminal.style import watched

if TYPE_CHECKING:
    from rich.progress import Progress

EVERY_S = 10.0
"""Time between two progress lines if no terminal shows a bar, s."""

Item = TypeVar("Item")


class TaskProgress:
    """Shows how many items, named by a plural noun, are done, and the time left; used as a context manager.

    Where no terminal shows the bar, ``lines`` writes ``reports 12/300, 0:00:40 left`` every ten seconds, by the average
    time per finished item.
    """

    def __init__(self, what: str, total: int, *, lines: bool = False, quiet: bool = False) -> None:
        self._what, self._total = what, total
        self._lines, self._quiet = lines and not quiet, quiet
        self._began_s = self._shown_s = time.monotonic()
        self._bar: Progress | None = None

    def __enter__(self) -> Self:
        if not self._quiet and watched(sys.stderr):
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.add_task(self._what, total=self._total)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, done: int) -> None:
        """Show the number of finished items."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=done, total=self._total)
            return
        now_s = time.monotonic()
        if not self._lines or not 0 < done < self._total or now_s - self._shown_s < EVERY_S:
            return
        self._shown_s = now_s
        left_s = (now_s - self._began_s) * (self._total - done) / done
        tell(f"{self._what} {done}/{self._total}, {timedelta(seconds=round(left_s))} left")


def counted(items: Iterable[Item], total: int, what: str, *, quiet: bool = False) -> Iterator[Item]:
    """Yield items, and show on a terminal how many are done if there are at least two."""
    with TaskProgress(what, total, quiet=quiet or total < 2) as progress:
        for done, item in enumerate(items, 1):
            yield item
            progress.update(done)
