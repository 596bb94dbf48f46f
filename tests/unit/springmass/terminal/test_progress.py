"""How far a task is, where no terminal shows a bar."""

from __future__ import annotations

import pytest

from springmass.terminal.progress import TaskProgress, counted


def test_a_line_comes_now_and_then_with_the_time_left(capsys: pytest.CaptureFixture[str]) -> None:
    """One line for ten seconds at most, none at the end; the time left follows from the mean so far."""
    clock = iter([0.0, 5.0, 12.0, 13.0, 30.0, 60.0])
    with TaskProgress("reports", 300, lines=True, seconds=lambda: next(clock)) as progress:
        for done in (50, 100, 110, 250, 300):
            progress.update(done)
    assert capsys.readouterr().err.splitlines() == ["reports 100/300, 24 s left", "reports 250/300, 6 s left"]


def test_the_total_may_come_with_the_first(capsys: pytest.CaptureFixture[str]) -> None:
    """Hours and minutes are shown where it takes so long; nothing while the total is not known."""
    clock = iter([0.0, 20.0, 60.0])
    with TaskProgress("runs", lines=True, seconds=lambda: next(clock)) as progress:
        progress.update(1)
        progress.update(2, 262)
    assert capsys.readouterr().err.splitlines() == ["runs 2/262, 2 h 10 min left"]


@pytest.mark.parametrize("how", [{"lines": True, "quiet": True}, {}])
def test_no_line_comes_unless_asked_for(capsys: pytest.CaptureFixture[str], how: dict[str, bool]) -> None:
    """Off a terminal nothing is shown where lines are not wanted, or where it shall be quiet."""
    clock = iter([0.0, 20.0])
    with TaskProgress("runs", 3, seconds=lambda: next(clock), **how) as progress:
        progress.update(1)
    assert capsys.readouterr().err == ""


def test_counted_yields_every_item() -> None:
    """Items come in their order."""
    assert list(counted("abc", 3, "letters")) == ["a", "b", "c"]
