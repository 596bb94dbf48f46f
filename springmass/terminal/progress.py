"""Show the progress of a long task on stderr: a temporary bar on a terminal, elsewhere optional lines."""

import contextlib
import logging
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from datetime import timedelta
from typing import TypeVar

from springmass.errors import LOG
from springmass.terminal.style import watched

EVERY_S = 10.0
"""Time between two progress lines if no terminal shows a bar, s."""

Item = TypeVar("Item")


@contextlib.contextmanager
def counting(what: str, total: int, *, lines: bool = False) -> Iterator[Callable[[int], None]]:
    """Yield a function that shows how many of the items, named by a plural noun, are done, and the time left.

    Where no terminal shows the bar, ``lines`` writes ``reports 12/300, 0:00:40 left`` every ten seconds, by the average
    time per finished item.
    """
    if not (LOG.isEnabledFor(logging.INFO) and watched(sys.stderr)):
        began_s = shown_s = time.monotonic()
        began = 0

        def write(done: int) -> None:
            nonlocal shown_s, began_s, began
            now_s = time.monotonic()
            if not began:  # the first items take as long as the worker processes take to start
                began_s, began = now_s, done
            elif lines and began < done < total and now_s - shown_s >= EVERY_S:
                shown_s = now_s
                left_s = (now_s - began_s) * (total - done) / (done - began)
                LOG.info(f"{what} {done}/{total}, {timedelta(seconds=round(left_s))} left")

        yield write
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def counted(items: Iterable[Item], total: int, what: str) -> Iterator[Item]:
    """Yield items, and show on a terminal how many are done if there are at least two."""
    if total < 2:
        yield from items
        return
    with counting(what, total) as update:
        for done, item in enumerate(items, 1):
            yield item
            update(done)


def counted_figures(charts: Collection[Item]) -> Iterator[Item]:
    """Yield charts to be drawn, and show on a terminal how many are."""
    return counted(charts, len(charts), "figures")
