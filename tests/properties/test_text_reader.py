"""The reader of rows: every number to the last bit, and odd rows that leave their neighbours alone."""

from __future__ import annotations

import math
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.recordings.tables.table import read_table
from acquisition.recordings.tables.text import Text

PLAIN_CELL = st.decimals(-9999, 9999, places=3, allow_nan=False).map(lambda d: f"{d:.3f}")


def regular_lines(count: int = 3000) -> list[str]:
    """Return rows as the sensor's program prints them."""
    t = np.arange(count) / 100
    return [f"{a:.3f}\t{25 + 6 * np.sin(8 * a):.3f}\t0.239" for a in t]


def test_odd_rows_leave_the_numbers_of_their_neighbours_alone() -> None:
    """Comments, lost columns, lower-case NaN and blank lines are marked or make no row; all others are read."""
    lines = regular_lines()
    odd = ["here I touched it", "", "  ", "0.5\t25.1", "1.000\tnan\t0.239", "1.000\t25,100\t0.239"]
    mixed = [
        line for at, sound in enumerate(lines) for line in ([odd[at // 100 % 6]] if at % 100 == 0 else []) + [sound]
    ]
    table = read_table(Text.of("\n".join([*mixed, ""]).encode()), range(3), "\t", width=3)
    kept = [line for line in mixed if line.strip()]
    sound = np.array([line in set(lines) for line in kept])
    assert len(table) == len(kept)
    assert not table.unread[sound].any()
    assert table.values[1][sound].tolist() == [float(line.split("\t")[1]) for line in lines]
    assert int(table.unread.sum()) == 10  # of the words and of the lost columns


@pytest.mark.parametrize("delimiter", ["\t", ";", "  "])
def test_a_file_of_many_pages_has_no_seams(delimiter: str) -> None:
    """Rows are found whole wherever a page ends, whatever ends a line."""
    lines = [line.replace("\t", delimiter) for line in regular_lines(40_000)]
    expected = [[float(cell) for cell in line.split(delimiter)] for line in lines]
    for newline in ("\n", "\r\n", "\r"):
        text = Text.of(newline.join(lines).encode())
        table = read_table(text, (0, 1), delimiter.strip(" "), width=None)
        assert table.values[1].tolist() == [row[1] for row in expected]
        assert table.values[0].tolist() == [row[0] for row in expected]
        assert (table.line(39_999), int(table.unread.sum())) == (40_000, 0)


EXPONENT_CELL = st.builds(
    lambda digits, decimals, power: f"{digits / 10**decimals:.{decimals}f}E{power}",
    st.integers(-(10**9), 10**9),
    st.integers(0, 9),
    st.integers(-30, 30),
)


@settings(max_examples=300, deadline=None)
@given(
    column=st.lists(st.one_of(EXPONENT_CELL, PLAIN_CELL, st.integers(-99, 99).map(str)), min_size=1, max_size=60),
    shift=st.sampled_from([0, -2, -3, -6]),
)
def test_every_form_of_number_is_read_as_a_decimal_number(column: list[str], shift: int) -> None:
    """Exponents, whole numbers and fixed point in any mixture, and a power of ten: rounded once, as decimals are."""
    table = read_table(Text.of("\n".join([*column, ""]).encode()), (0,), ";", shifts=(shift,))
    for cell, value, bad in zip(column, table.values[0], table.unread, strict=True):
        assert bad or value == float(Decimal(cell).scaleb(shift))


@st.composite
def fixed_columns(draw: st.DrawFn) -> tuple[list[str], str]:
    """Draw numbers of one column, of up to 17 digits with as many decimals each, all of one width or not."""
    decimals = draw(st.integers(0, 14))
    digits = draw(st.integers(decimals + 1, 17))
    low = 10 ** (digits - 1) if draw(st.booleans()) else 0
    sign = draw(st.sampled_from(["", "-", None]))
    numbers = draw(st.lists(st.integers(low, 10**digits - 1), min_size=1, max_size=40))
    printed = [f"{n:0{decimals + 1}d}" for n in numbers]
    cells = [f"{n[: len(n) - decimals]}.{n[len(n) - decimals :]}" if decimals else n for n in printed]
    return [(draw(st.sampled_from(["", "-"])) if sign is None else sign) + cell for cell in cells], draw(
        st.sampled_from(["\n", "\r\n"])
    )


@settings(max_examples=400, deadline=None)
@given(column=fixed_columns(), beside=st.sampled_from(["", "0.239\t", "1\t"]), shift=st.sampled_from([0, -2, -3, 2]))
def test_fixed_point_is_read_bit_for_bit(column: tuple[list[str], str], beside: str, shift: int) -> None:
    """Lines laid out alike and lines that are not: every digit, sign and power of ten as one correct rounding."""
    cells, newline = column
    text = "".join(f"{beside}{cell}{newline}" for cell in cells)
    table = read_table(Text.of(text.encode()), (beside.count("\t"),), "\t", shifts=(shift,))
    assert not table.unread.any()
    for cell, value in zip(cells, np.asarray(table.values[0]).tolist(), strict=True):
        exact = float(Decimal(cell).scaleb(shift))
        assert (value, math.copysign(1.0, value)) == (exact, math.copysign(1.0, exact))


@pytest.mark.parametrize("odd", ["1-2\t\t3", "1\t-\t3", "1\t+-2\t3", "1 2\t3", "1\t2-\t3", "1\t\t3"])
def test_as_many_numbers_as_cells_are_not_taken_for_one_in_each(odd: str) -> None:
    """A row whose numbers do not stand one in each cell is marked, and its neighbours are read."""
    table = read_table(Text.of(f"1\t2\t3\n{odd}\n-4\t5\t+6\n".encode()), (0, 1, 2), "\t", width=3)
    assert table.unread.tolist() == [False, True, False]
    assert [column[2] for column in table.values] == [-4.0, 5.0, 6.0]


def test_engineering_notation_has_fewer_decimals_where_its_exponent_is_smaller() -> None:
    """Numbers that end at the place of all others are whole; one that lost a digit of its mantissa is marked."""
    cells = [f"{k / 40:.5f}E-03" if abs(k) >= 40 else f"{k * 25:.2f}E-06" for k in range(-500, 500)]
    cells = [cell.replace("0.00E-06", "0.0E+00") if float(cell) == 0 else cell for cell in cells]
    assert not read_table(Text.of("\n".join([*cells, ""]).encode()), (0,), ",").unread.any()
    cells[505], cells[700] = "125.0E-06", "5.0000E-03"
    bad = read_table(Text.of("\n".join([*cells, ""]).encode()), (0,), ",").unread
    assert np.flatnonzero(bad).tolist() == [505, 700]
