"""How far a long task is, on a terminal: one line on stderr, gone at its end."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from springmass.terminal.look import watched

__all__ = ["counted"]

Item = TypeVar("Item")


def counted(items: Iterable[Item], total: int, what: str, *, quiet: bool = False) -> Iterator[Item]:
    """Yield items, and show how many came of how many; elsewhere than on a terminal nothing is shown."""
    if quiet or total < 2 or not watched(sys.stderr):
        yield from items
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield from bar.track(items, total=total, description=what)
