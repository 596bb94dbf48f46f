"""Test the accuracy benchmark in its short form: every requirement is measured, and none fails by a wide margin."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import checks

SEEDS = 8
# The parts of the benchmark, by the names that `--only` accepts.
PARTS = ("efficiency", "damping", "laws", "echoes", "weak", "invariance", "ranges")


def test_every_part_is_tested() -> None:
    """The list in this module equals the list of the command."""
    assert tuple(checks.CHECKS) == PARTS


@pytest.mark.trials
@pytest.mark.parametrize("part", PARTS)
def test_requirements_hold_in_short_form(part: str) -> None:
    """With few seeds, no limit is exceeded by more than the scatter allows."""
    lines = list(checks.CHECKS[part](checks.Bench(SEEDS, map)))
    assert lines
    missed = [f"{line.what}: {line.measured}, {line.limit}" for line in lines if not line.ok]
    assert not missed, "\n".join(missed)


@pytest.mark.parametrize(
    ("share", "count", "low", "high", "ok"),
    [
        (0.68, 2000, 0.66, 0.70, True),
        (0.64, 2000, 0.66, 0.70, True),
        (0.62, 2000, 0.66, 0.70, False),
        (0.75, 2000, 0.66, 0.70, False),
        (0.93, 2000, 0.95, 1.0, False),
        (0.0, 20, 0.95, 1.0, False),
        (1.0, 20, 0.0, 0.02, False),
    ],
)
def test_a_share_beyond_its_scatter_fails(share: float, count: int, low: float, high: float, ok: bool) -> None:
    """A measured share may exceed its limit by at most three standard errors."""
    assert checks.share_line("share", share, count, low, high).ok is ok


def test_errors_beyond_the_limit_fail() -> None:
    """Errors of 1.3 bounds, a bias of a quarter of a bound and uncertainties of half a bound exceed every limit."""
    rng = np.random.default_rng(1)
    error = 1.3 * rng.standard_normal(2000) + 0.25
    lines = list(checks.quantity_lines("", error, np.full(2000, 0.5), "best"))
    assert [line.ok for line in lines] == [False] * 4
    fair = list(checks.quantity_lines("", rng.standard_normal(2000), np.ones(2000), "best"))
    assert [line.ok for line in fair] == [True] * 4
