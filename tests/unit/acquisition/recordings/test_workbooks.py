"""Workbooks and archives: what cells, sheets and files inside become, and what is refused before it is unpacked."""

import sys

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import get_format
from acquisition.recordings.questions import Missing
from acquisition.recordings.reading import ReadOptions
from tests.conformance.test_formats import cells, packed, workbook

WORKBOOK, ZIP = get_format("workbook"), get_format("zip")


def rows(*columns: list[str]) -> str:
    """Write rows of cells from the second line on; a cell is its attributes and its value, or empty."""
    lines = []
    for i, row in enumerate(zip(*columns, strict=True), 2):
        inner = "".join(
            f'<c r="{chr(65 + at)}{i}"{" s=" + chr(34) + "1" + chr(34) if cell.startswith("@") else ""}>'
            f"<v>{cell.removeprefix('@')}</v></c>"
            for at, cell in enumerate(row)
            if cell
        )
        lines.append(f'<row r="{i}">{inner}</row>')
    return "".join(lines)


VALUES = [f"{0.2 + 0.01 * i}" for i in range(20)]
TIMES = [f"{0.1 * i}" for i in range(20)]


def test_a_time_of_the_day_counts_from_the_first() -> None:
    """A cell with a time is a share of the day, whatever it shows."""
    reported = [f"@{(86390 + i) % 86400 / 86400!r}" for i in range(20)]
    data = workbook({"A": cells("Time", "Position (m)") + rows(reported, VALUES)})
    samples = WORKBOOK.read("run.xlsx", data).samples
    np.testing.assert_allclose(samples.t, np.arange(20.0), atol=1e-6)
    np.testing.assert_allclose(samples.distance, np.array(VALUES, float), rtol=1e-14)


def test_several_sheets_are_runs_of_which_one_is_named() -> None:
    """One question asks for everything that is missing, and a sheet without times is reported and skipped."""
    sheet = cells("t (s)", "y") + rows(TIMES, VALUES)
    spectrum = cells("Frequency (Hz)", "A") + rows(VALUES[::-1], VALUES)
    data = workbook({"first": sheet, "second": sheet, "FFT": spectrum})
    with pytest.raises(NeedsAnswer) as caught:
        WORKBOOK.read("run.xlsx", data)
    assert caught.value.question.missing == (Missing.RUN, Missing.UNIT)
    assert caught.value.question.needs[0].choices == ("first", "second")
    recording = WORKBOOK.read("run.xlsx", data, ReadOptions(run="second", unit="m"))
    assert recording.run == "second"


def test_what_unpacks_to_more_than_it_may_is_refused() -> None:
    """A bomb is refused by the sizes that it states."""
    bomb = packed({"run.csv": b"0,1\n" * (1 << 26)} | {"run2.csv": b"0"})
    assert len(bomb) < 1 << 20
    with pytest.raises(FormatError, match="bytes"):
        ZIP.read("run.zip", bomb)


def test_an_archive_of_several_runs_asks_which() -> None:
    """Pictures are passed over and named; each file is read as what it is."""
    csv, picture = b"Time (s),Position (m)\n0.0,0.1\n0.1,0.2\n0.2,0.4\n0.3,0.1\n", b"\x89PNG" + bytes(99)
    data = packed({"a.csv": csv, "b.txt": csv.replace(b",", b"\t"), "bench.png": picture, "__MACOSX/a.csv": csv})
    with pytest.raises(NeedsAnswer) as caught:
        ZIP.read("run.zip", data)
    assert caught.value.question.needs[0].choices == ("a.csv", "b.txt")
    recording = ZIP.read("run.zip", data, ReadOptions(run="b.txt"))
    assert recording.samples.distance.tolist() == [0.1, 0.2, 0.4, 0.1]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="no limit of memory there")
def test_a_workbook_that_needs_too_much_memory_is_refused_in_one_line() -> None:
    """The child process ends at its limit of memory, and this one goes on."""
    data = workbook({"A": cells("t (s)") + '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'})
    with pytest.raises(FormatError, match=r"^run\.xlsx: [^\n]*$"):
        WORKBOOK.read("run.xlsx", data)
