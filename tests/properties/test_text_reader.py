"""Whatever happens to a file, its reader refuses it in one line or tells the truth."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.errors import FormatError
from acquisition.recordings.families.motion_sensor import FORMAT
from acquisition.recordings.recording import Recording
from acquisition.recordings.tables.table import read_table
from acquisition.recordings.tables.text import Text, decode, parse_number, split_cells, unify

PLAIN_CELL = st.decimals(-9999, 9999, places=3, allow_nan=False).map(lambda d: f"{d:.3f}")
NUMBER = re.compile(r"[^\t ;\n]+")


@st.composite
def motion_files(draw: st.DrawFn) -> bytes:
    """Draw a sound file: position or velocity, with or without header, at some rate."""
    rate = draw(st.sampled_from([60.0, 100.0, 125.0]))
    count = draw(st.integers(3, 40))
    start = draw(st.integers(0, 900))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    t = (start + np.arange(count)) / rate
    x = 20 + 5 * np.sin(8 * t) + 0.01 * rng.standard_normal(count)
    if draw(st.booleans()):
        header = ["Motion Sensor Data File Sep 20, 2018 1:40 PM", "Time (s)\tDistance (cm)\tDist Error (cm)"]
        rows = [f"{a:.3f}\t{b:.3f}\t0.239" for a, b in zip(t, x, strict=True)]
    else:
        header = ["velocity Oct 20, 2022 10:08 AM", "Time (s)\tVelocity (cm/s)"]
        rows = [f"{a:.3f}\t{b:.3f}" for a, b in zip(t, np.diff(x, prepend=x[0]) * rate, strict=True)]
        rows[0] = f"{t[0]:.3f}\tNaN"
    lines = [*header[draw(st.integers(0, 2)) :], *rows]
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = newline.join(lines) + draw(st.sampled_from(["", newline]))
    return text.encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le"])))


@st.composite
def mangled(draw: st.DrawFn) -> bytes:
    """Draw a file and damage it a few times."""
    data = draw(motion_files())
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        length = draw(st.integers(0, 60))
        match draw(st.sampled_from(["cut", "drop", "flip", "splice", "comma", "nul", "column", "insert"])):
            case "cut":
                data = data[:at]
            case "drop":
                data = data[:at] + data[at + length :]
            case "flip":
                data = data[:at] + bytes([draw(st.integers(0, 255))]) + data[at + 1 :]
            case "splice":
                other = draw(st.integers(0, max(len(data) - 1, 0)))
                data = data[:at] + data[other : other + length] + data[at:]
            case "comma":
                data = data.replace(b".", b",", draw(st.integers(-1, 40)))
            case "nul":
                data = data[:at] + b"\0" * length + data[at + length :]
            case "column":
                data = re.sub(rb"\t[^\t\r\n]*", b"", data, count=draw(st.integers(1, 20)))
            case "insert":
                data = data[:at] + draw(st.binary(max_size=12)) + data[at:]
    return data


def read(data: bytes) -> Recording | str:
    """Return the recording, or the message of the refusal."""
    try:
        return FORMAT.read("run.txt", data)
    except FormatError as error:
        return str(error)


def printed_pairs(data: bytes) -> list[tuple[float, float]]:
    """Return (time, second number) of every line of a file that has both."""
    pairs = []
    for line in unify(decode(data)).split("\n"):
        cells = [parse_number(cell.strip("\0\x1a")) for cell in NUMBER.findall(line)]
        cells += [parse_number(cell) for cell in split_cells(line, ",")]
        for t, value in pairwise(cells):
            if t is not None and value is not None:
                pairs.append((t, value))
    return pairs


@settings(max_examples=400, deadline=None)
@given(data=mangled())
def test_a_mangled_file_is_refused_in_one_line_or_read_truly(data: bytes) -> None:
    """Every unflagged finite value of a mangled file stands in it beside that time."""
    recording = read(data)
    if isinstance(recording, str):
        assert "\n" not in recording
        assert recording.startswith("run.txt")
        return
    samples = recording.samples
    stated = samples.distance if recording.channel == "distance" else samples.velocity
    assert stated is not None
    sound = (samples.flags & ~np.uint8(64)) == 0
    pairs = np.array(printed_pairs(data)).reshape(-1, 2)
    for t, value in zip(samples.t[sound], stated[sound], strict=True):
        if np.isfinite(value):
            at = np.abs(pairs[:, 0] - t) <= 0.00051
            assert (np.abs(pairs[at, 1] / 100 - value) <= 1e-12 * (1 + abs(value))).any()
    assert (np.diff(samples.t[sound]) > 0).all()
    assert recording.originals[0].data == data


@settings(max_examples=400, deadline=None)
@given(data=st.one_of(mangled(), st.binary(max_size=200)))
def test_recognising_never_raises(data: bytes) -> None:
    """Any bytes are recognised or not."""
    assert FORMAT.recognises(data) in (True, False)


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
    assert not table.bad[sound].any()
    assert table.values[1][sound].tolist() == [float(line.split("\t")[1]) for line in lines]
    assert int(table.bad.sum()) == 10  # of the words and of the lost columns


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
        assert (table.line(39_999), int(table.bad.sum())) == (40_000, 0)


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
    for cell, value, bad in zip(column, table.values[0], table.bad, strict=True):
        assert bad or value == float(Decimal(cell).scaleb(shift))


@settings(max_examples=300, deadline=None)
@given(cell=PLAIN_CELL)
def test_a_cell_is_read_as_float_reads_it(cell: str) -> None:
    """Taking digits as an integer over a power of ten loses nothing against ``float()``."""
    assert read_table(Text.of(f"{cell}\n".encode()), (0,), "\t", width=1).values[0][0] == float(cell)
    assert parse_number(cell.replace(".", ",")) == float(cell)


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
    assert not table.bad.any()
    for cell, value in zip(cells, np.asarray(table.values[0]).tolist(), strict=True):
        exact = float(Decimal(cell).scaleb(shift))
        assert (value, math.copysign(1.0, value)) == (exact, math.copysign(1.0, exact))


@pytest.mark.parametrize("odd", ["1-2\t\t3", "1\t-\t3", "1\t+-2\t3", "1 2\t3", "1\t2-\t3", "1\t\t3"])
def test_as_many_numbers_as_cells_are_not_taken_for_one_in_each(odd: str) -> None:
    """A row whose numbers do not stand one in each cell is marked, and its neighbours are read."""
    table = read_table(Text.of(f"1\t2\t3\n{odd}\n-4\t5\t+6\n".encode()), (0, 1, 2), "\t", width=3)
    assert table.bad.tolist() == [False, True, False]
    assert [column[2] for column in table.values] == [-4.0, 5.0, 6.0]


def test_engineering_notation_has_fewer_decimals_where_its_exponent_is_smaller() -> None:
    """Numbers that end at the place of all others are whole; one that lost a digit of its mantissa is marked."""
    cells = [f"{k / 40:.5f}E-03" if abs(k) >= 40 else f"{k * 25:.2f}E-06" for k in range(-500, 500)]
    cells = [cell.replace("0.00E-06", "0.0E+00") if float(cell) == 0 else cell for cell in cells]
    assert not read_table(Text.of("\n".join([*cells, ""]).encode()), (0,), ",").bad.any()
    cells[505], cells[700] = "125.0E-06", "5.0000E-03"
    bad = read_table(Text.of("\n".join([*cells, ""]).encode()), (0,), ",").bad
    assert np.flatnonzero(bad).tolist() == [505, 700]
