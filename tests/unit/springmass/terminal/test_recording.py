"""The lines of a recording on a terminal, its trace, and what makes readings useless."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.block import Block, Flag
from acquisition.decoders.registry import get_family
from pipeline.numerics.estimate import Estimate
from pipeline.streaming import LiveMotion
from springmass.session.display.progress import TroubleKind, Usefulness
from springmass.terminal.recording import trust_in
from springmass.terminal.trace import LABEL, ROWS, trace_of

LINES = get_family("line-protocol")


def block(first: int, distance: list[float] | np.ndarray) -> Block:
    """Return samples at 100 Hz; NaN is flagged missing."""
    values = np.asarray(distance, np.float64)
    flags = np.where(np.isnan(values), np.uint8(Flag.MISSING), np.uint8(0)).astype(np.uint8)
    return Block(first, (first + np.arange(values.size)) / 100.0, values, flags)


def test_only_no_target_codes_are_said_until_a_distance_comes() -> None:
    """The time counts over the blocks, from the first sample without a target."""
    useful = Usefulness()
    useful.push(block(0, [0.2 + 0.001 * i for i in range(50)]))
    assert useful.trouble(LINES) is None
    for first in range(50, 250, 50):
        useful.push(block(first, [np.nan] * 50))
    trouble = useful.trouble(LINES)
    assert trouble is not None
    assert trouble.kind is TroubleKind.NO_TARGET
    assert "2 s" in trouble.text
    assert "0.02 to 1.6 m" in trouble.text
    useful.push(block(250, [np.nan, 0.3, 0.31]))
    assert useful.trouble(LINES) is None
    assert useful.usable == 52


def test_one_distance_all_the_time_is_said_until_it_changes() -> None:
    """A stuck echo and a bob at rest look alike: both are asked about."""
    useful = Usefulness()
    for first in (0, 60):
        useful.push(block(first, [0.253] * 60))
    trouble = useful.trouble(LINES)
    assert trouble is not None
    assert trouble.kind is TroubleKind.UNCHANGED
    assert "253.0 mm" in trouble.text
    useful.push(block(120, [0.253, 0.254]))
    assert useful.trouble(LINES) is None


@pytest.mark.parametrize(
    ("u_period", "u_amplitude", "missing", "trust"),
    [(1e-4, 1e-4, 0.0, "good"), (1e-4, 1e-4, 0.2, "fair"), (2e-3, 1e-4, 0.0, "fair"), (1e-4, 2e-2, 0.0, "poor")],
)
def test_trust_falls_with_uncertainty_and_missing_readings(
    u_period: float, u_amplitude: float, missing: float, trust: str
) -> None:
    """Each bound of the docstring by itself."""
    zero = Estimate(0.2, 0.0, "m")
    found = LiveMotion(Estimate(0.8, u_period, "s"), Estimate(0.05, u_amplitude, "m"), zero, zero, 8.0)
    assert trust_in(found, missing) == trust


def test_the_trace_shows_crests_above_troughs_and_holes_where_nothing_was_measured() -> None:
    """Two periods of a cosine: the top row is dotted at crests, the bottom row at troughs, a gap is blank."""
    t = np.arange(400) / 100.0
    y = 0.25 + 0.05 * np.cos(np.pi * t)
    y[190:210] = np.nan
    lines = trace_of(t, y, 60 + LABEL, 4.0)
    assert len(lines) == ROWS
    rows = [[cell != "\u2800" for cell in line[:60]] for line in lines]
    assert rows[0][1]
    assert not rows[-1][1]
    assert rows[-1][15]
    assert not rows[0][15]
    assert not any(row[29] for row in rows)
    high, low = (float(line.split()[-2]) for line in (lines[0], lines[-1]))
    assert 299.0 < high <= 300.0
    assert 200.0 <= low < 201.0
    assert max(map(len, lines)) <= 60 + LABEL


def test_a_false_echo_does_not_flatten_the_trace() -> None:
    """One reading in a hundred a metre away stands at the edge, and the motion keeps its rows."""
    t = np.arange(400) / 100.0
    y = 0.25 + 0.05 * np.cos(np.pi * t)
    y[::100] = 1.3
    assert trace_of(t, y, 70, 4.0)[0].endswith(" 299.9 mm")


def test_no_samples_and_no_room_leave_the_rows_empty() -> None:
    """Before the first sample and on a terminal of a few columns nothing is drawn."""
    assert trace_of(np.empty(0), np.empty(0), 80, 4.0) == [""] * ROWS
    assert trace_of(np.arange(3.0), np.full(3, 0.2), LABEL, 4.0) == [""] * ROWS
