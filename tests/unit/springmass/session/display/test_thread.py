"""The display has a separate thread, and whatever it raises stays there."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from acquisition.block import Block
from springmass.session.display import thread as displayed
from springmass.session.display.progress import LiveState, Progress
from springmass.session.display.thread import Display
from springmass.session.failures import KINDS, Failures

WAIT_S = 60.0


def samples() -> Sequence[tuple[int, Block]]:
    """Return a sample."""
    return [(0, Block(0, np.zeros(1), np.ones(1), np.zeros(1, np.uint8), np.zeros(1, np.int64)))]


def look(shown: LiveState) -> Progress:
    """Return how many samples were shown."""
    return cast(Progress, SimpleNamespace(samples=shown.samples))


@pytest.mark.parametrize("error", [IndexError("no such index"), MemoryError(), SystemExit(3), RecursionError()])
def test_what_a_turn_raises_is_counted_and_the_next_turn_comes(
    monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    """The first failure is told; the display shows again as soon as it can."""
    monkeypatch.setattr(displayed, "LAST_S", WAIT_S)
    failures, events, shown = Failures(), [], threading.Event()
    failures.tell = lambda kind, facts: events.append((kind, facts["error"]))

    def show(progress: Progress) -> None:
        if progress.samples < 3:
            raise error
        shown.set()

    display = Display(LiveState(100.0), show, failures)
    for _ in range(1000):
        display.ring(samples, look)
        if shown.wait(0.01):
            break
    display.close()
    assert shown.is_set()
    assert events == [("display_failed", type(error).__name__)]
    assert list(failures.counts.values()) == [2]


def test_a_turn_that_hangs_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rings and the end do not wait for it, and that it hangs is a failure."""
    monkeypatch.setattr(displayed, "LAST_S", 0.01)
    failures, begun, go_on = Failures(), threading.Event(), threading.Event()

    def show(_: Progress) -> None:
        begun.set()
        go_on.wait(WAIT_S)

    display = Display(LiveState(100.0), show, failures)
    display.ring(samples, look)
    assert begun.wait(WAIT_S)
    for _ in range(5):
        display.ring(samples, look)
    display.close()
    assert [name.split(" at ")[0] for name in failures.counts] == ["display: TimeoutError"]
    go_on.set()


def test_failures_are_told_apart_up_to_a_number() -> None:
    """Each kind by what failed, error and line; those beyond are counted together."""
    failures = Failures()
    events: list[Any] = []
    failures.tell = lambda *event: events.append(event)
    for number in range(KINDS + 5):
        failures.note(f"part{number}", ValueError("x"))
        failures.note(f"part{number}", ValueError("x"))
    assert len(events) == KINDS
    assert failures.counts["others"] == 10
    assert sum(failures.counts.values()) == 2 * (KINDS + 5)
    assert sum("2 times" in line for line in failures.describe()) == KINDS
