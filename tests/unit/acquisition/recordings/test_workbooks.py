"""Workbooks and archives: what cells, sheets and files inside become, and what is refused before it is unpacked."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import get_format
from acquisition.recordings.questions import Missing
from tests.conformance.test_formats import cells, packed, workbook

WORKBOOK, ZIP = get_format("workbook"), get_format("zip")
OLE = bytes.fromhex("d0cf11e0a1b11ae1")


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
    recording = WORKBOOK.read("run.xlsx", data, run="second", unit="m")
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
    recording = ZIP.read("run.zip", data, run="b.txt")
    assert recording.samples.distance.tolist() == [0.1, 0.2, 0.4, 0.1]


def record(kind: int, *parts: bytes) -> bytes:
    """Return a record of BIFF."""
    content = b"".join(parts)
    return struct.pack("<HH", kind, len(content)) + content


def number(row: int, column: int, value: float) -> bytes:
    """Return the record of a cell."""
    return record(0x203, struct.pack("<HHHd", row, column, 0, value))


END, BOOK, SHEET = (
    record(0x0A),
    record(0x809, struct.pack("<HH12x", 0x600, 5)),
    record(0x809, struct.pack("<HH12x", 0x600, 16)),
)
SAMPLES = b"".join(number(i, 0, 0.1 * i) + number(i, 1, 0.2 + 0.01 * (i % 7)) for i in range(40))


def container(stream: bytes) -> bytes:
    """Return an OLE file (MS-CFB, sectors of 4096 bytes) with one stream, ``Workbook``."""
    filled = max(-(-len(stream) // 4096), 1)
    tables = 1
    while tables * 1024 < filled + 1 + tables:
        tables += 1
    free, end, table = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD
    chain = np.full(tables * 1024, free, "<u4")
    chain[: filled - 1] = np.arange(1, filled)
    chain[[filled - 1, filled]] = end
    chain[filled + 1 : filled + 1 + tables] = table
    header = OLE + bytes(16) + struct.pack("<5H6x", 0x3E, 3, 0xFFFE, 12, 6)
    header += struct.pack("<9I", 0, tables, filled, 0, 4096, end, 0, end, 0)
    header += np.arange(filled + 1, filled + 1 + tables, dtype="<u4").tobytes().ljust(436, b"\xff")

    def entry(name: str, kind: int, start: int, length: int, below: int) -> bytes:
        text = name.encode("utf-16-le")
        return (
            text.ljust(64, b"\0")
            + struct.pack("<HBB3I", len(text) + 2, kind, 1, free, free, below)
            + bytes(36)
            + struct.pack("<IQ", start, length)
        )

    directory = entry("Root Entry", 5, end, 0, 1) + entry("Workbook", 2, 0, filled * 4096, free)
    sectors = (header, stream.ljust(filled * 4096, b"\0"), directory.ljust(4096, b"\0"), chain.tobytes())
    return sectors[0].ljust(4096, b"\0") + b"".join(sectors[1:])


def xls(content: bytes, *, book: bytes = b"", sheets: int = 1) -> bytes:
    """Return an xls whose sheets are all at one place."""
    names = [record(0x85, struct.pack("<IBBBB", 0, 0, 0, 1, 0), bytes([65 + i % 26])) for i in range(sheets)]
    at = len(BOOK + book + b"".join(names) + END)
    names = [each[:4] + struct.pack("<I", at) + each[8:] for each in names]
    return container(BOOK + book + b"".join(names) + END + SHEET + content + END)


def test_an_xls_is_read_with_every_kind_of_value() -> None:
    """Numbers, packed numbers, formulas and shared words, also of one that goes on in the next record."""
    words = struct.pack("<II", 2, 2) + struct.pack("<HB", 5, 0) + b"t (s)" + struct.pack("<HB", 5, 0) + b"x ("
    strings = record(0xFC, words) + record(0x3C, b"\x00m)")
    heading = b"".join(record(0xFD, struct.pack("<HHHI", 0, column, 0, column)) for column in (0, 1))
    times = b"".join(number(i + 1, 0, 0.1 * i) for i in range(20))
    packed = b"".join(record(0x27E, struct.pack("<HHHi", i + 1, 1, 0, (100 + i) << 2 | 3)) for i in range(10))
    formulas = b"".join(
        record(0x06, struct.pack("<HHHdHI", i + 1, 1, 0, 0.5 * i, 0, 0), b"\x03\x00\x1e\x01\x00") for i in range(10, 20)
    )
    recording = WORKBOOK.read("run.xls", xls(heading + times + packed + formulas, book=strings))
    assert (recording.channel, recording.info.rate_hz, recording.samples.unit) == ("x", 10.0, "m")
    np.testing.assert_allclose(recording.samples.distance, [*(1.0 + 0.01 * np.arange(10)), *(0.5 * np.arange(10, 20))])


HOSTILE = {
    "a cell in the last row and column": xls(SAMPLES + number(65535, 65535, 1.0)),
    "a cell in the last row and column of an xlsx": workbook(
        {"A": cells("t (s)") + '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'}
    ),
}
limited = pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="no limit of memory there")


@limited
@pytest.mark.parametrize("name", HOSTILE)
def test_a_workbook_that_needs_too_much_memory_is_refused_in_one_line(name: str) -> None:
    """The child process ends at its limit of memory, and this one goes on."""
    with pytest.raises(FormatError) as caught:
        WORKBOOK.read("run.xls", HOSTILE[name])
    assert str(caught.value).startswith("run.xls: ")
    assert "\n" not in str(caught.value)
