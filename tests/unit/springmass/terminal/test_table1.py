"""Table 1 on a pipe and on terminals of several widths."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.numerics.estimate import Estimate
from pipeline.track import Track
from springmass.report.tables import prefixed, table_estimates, table_rows
from springmass.terminal.quantities import concise, shown
from springmass.terminal.style import PLAIN, TerminalStyle
from springmass.terminal.table1 import text_table

COLOUR = re.compile(r"\x1b\[[\d;]*m")


@pytest.fixture(scope="module")
def run() -> Analysis:
    """Return the analysis of twenty seconds of a damped bob."""
    t = np.arange(2000) / 100
    y = 0.2 + 0.05 * np.exp(-0.02 * t) * np.cos(8.3 * t)
    return analyse(Track.from_arrays(t, y + 1e-4 * np.random.default_rng(1).standard_normal(t.size)))


def test_a_pipe_gets_ascii_in_si(run: Analysis) -> None:
    """Columns that do not fit follow in another block, names of runs are cut, not numbers."""
    names = ["a run with quite a long name é.txt", "b", "c", "d", "e"]
    table = text_table(names, [run] * 5)
    assert table.isascii()
    assert max(map(len, table.splitlines())) <= 100
    assert table.count("quantity") > 1
    alone = text_table(["b"], [run])
    assert all(row.cells[0] in alone for row in table_rows([run]))


def test_what_was_kept_of_a_run_prints_as_the_run_does(run: Analysis) -> None:
    """The estimates that come from another process make the same table."""
    assert text_table(["a", "b"], [run, table_estimates(run)]) == text_table(["a", "b"], [run, run])


@pytest.mark.parametrize("width", [60, 80, 132])
@pytest.mark.parametrize("count", [1, 3])
def test_a_terminal_gets_prefixes_and_rules_within_its_width(run: Analysis, width: int, count: int) -> None:
    """Lengths in millimetres with ± or digits in parentheses, and no line wider than the terminal."""
    table = COLOUR.sub("", text_table(["a", "b", "c"][:count], [run] * count, TerminalStyle(True, True, False, width)))
    assert max(map(len, table.splitlines())) <= width
    assert "mm" in table
    assert "+-" not in table
    assert "s⁻¹" in table
    assert "…" not in table


def test_a_terminal_without_unicode_gets_ascii(run: Analysis) -> None:
    """Latin-1 or POSIX terminals have no superscripts."""
    assert COLOUR.sub("", text_table(["é"], [run], TerminalStyle(True, False, False, 80))).isascii()


def test_no_color_leaves_no_colour(run: Analysis, monkeypatch: pytest.MonkeyPatch) -> None:
    """NO_COLOR takes the colours from a terminal; what is bold or dim stays."""
    monkeypatch.setenv("NO_COLOR", "1")
    table = text_table(["a"], [run], TerminalStyle(True, True, False, 80))
    assert not re.search(r"\x1b\[[\d;]*3\d[;m]", table)


@pytest.mark.parametrize(
    ("estimate", "short", "long"),
    [
        (Estimate(0.05145, 2e-5, "m"), "51.450(20) mm", "51.450 ± 0.020 mm"),
        (Estimate(8.36e-5, 9.6e-7, "m"), "83.60(96) µm", "83.60 ± 0.96 µm"),
        (Estimate(0.790066, 2.3e-5, "s"), "0.790066(23) s", "0.790066 ± 0.000023 s"),
        (Estimate(0.22137, 1.8e-4, "kg"), "221.37(18) g", "221.37 ± 0.18 g"),
        (Estimate(-8.36e-5, 9.6e-7, "1/s"), "−8.360(96) × 10⁻⁵ s⁻¹", "(−8.360 ± 0.096) × 10⁻⁵ s⁻¹"),
        (Estimate(2.0, 0.0, "m"), "2 m", "2 m"),
        (Estimate(float("nan"), 0.0, "m"), "nan ± 0 m", "nan ± 0 m"),
        (Estimate(1372.0, 44.0, ""), "1372(44)", "1372 ± 44"),
    ],
)
def test_quantities_read_as_people_write_them(estimate: Estimate, short: str, long: str) -> None:
    """A prefix that leaves 1 to 1000 in front of it, both ways to state u; a pipe gets SI."""
    style = TerminalStyle(True, True, False, 80)
    assert (concise(estimate, style), shown(estimate, style)) == (short, long)
    assert shown(estimate, PLAIN).isascii()
    assert prefixed(estimate).value == pytest.approx(
        estimate.value * {"mm": 1e3, "µm": 1e6, "g": 1e3}.get(prefixed(estimate).unit, 1.0), nan_ok=True
    )
