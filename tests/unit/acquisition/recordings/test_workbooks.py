"""Workbooks and archives: what cells, sheets and files inside become, and what is refused before it is unpacked."""

from __future__ import annotations

import io
import json
import struct
import subprocess
import sys
import zipfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.families.workbook import child, sheets
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


def test_numbers_of_few_digits_beside_long_ones_are_not_taken_for_cut() -> None:
    """A workbook keeps 0.3 and 0.30000000000000004 alike; no row is malformed and times are on their grid."""
    times = [repr(0.1 * i) for i in range(12)]
    values = [*(f"{0.2 + 0.01 * i:.2f}" for i in range(11)), "1"]
    recording = WORKBOOK.read("run.xlsx", workbook({"A": cells("t (s)", "y (cm)") + rows(times, values)}))
    assert recording.malformed_rows == 0
    assert recording.info.rate_hz == 10.0
    assert recording.samples.distance[-1] == 0.01


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
    assert any('"FFT"' in trap.message for trap in recording.traps if trap.code == "preamble")


@pytest.mark.parametrize("dimension", ["A1:XFD1048576", "B2:$ZZZ$99999", "A1:ZZZZZZ4294967"])
def test_a_sheet_that_states_too_many_cells_is_refused(dimension: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stated dimension is checked before a process is started."""
    monkeypatch.setattr(sys, "executable", "none")
    data = with_dimension(dimension)
    with pytest.raises(FormatError, match=r"8388608 cells.* \d{9}"):
        WORKBOOK.read("run.xlsx", data)


def test_a_zip_archive_without_sheets_is_no_workbook() -> None:
    """A document of another program may have the same parts, but sheets."""
    with pytest.raises(FormatError, match="sheets"):
        WORKBOOK.read("run.xlsx", packed({"[Content_Types].xml": b"<Types/>", "word/document.xml": b"<w/>"}))


@pytest.mark.parametrize("dimension", ["A1", "A1:B21", "B21:A1", "A1048000:B1048576"])
def test_a_stated_dimension_changes_no_value(dimension: str) -> None:
    """A sheet whose dimension is wrong, but not large, is read by its cells."""
    samples = WORKBOOK.read("run.xlsx", with_dimension(dimension)).samples
    np.testing.assert_allclose(samples.distance, np.array(VALUES, float), rtol=1e-14)


def with_dimension(dimension: str) -> bytes:
    """Return a workbook of one sheet with a stated dimension."""
    data = workbook({"A": cells("t (s)", "x (m)") + rows(TIMES, VALUES)})
    stated = f'<dimension ref="{dimension}"/><sheetData>'.encode()
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return packed({name: archive.read(name).replace(b"<sheetData>", stated) for name in archive.namelist()})


def test_what_unpacks_to_more_than_it_may_is_refused() -> None:
    """A bomb is refused by the sizes that it states."""
    bomb = packed({"run.csv": b"0,1\n" * (1 << 26)} | {"run2.csv": b"0"})
    assert len(bomb) < 1 << 20
    with pytest.raises(FormatError, match="268435456 bytes"):
        ZIP.read("run.zip", bomb)


def test_a_bomb_that_lies_about_its_size_is_refused() -> None:
    """No more is unpacked than is stated, and the check sum then fails."""
    bomb = packed({"run.csv": b"0,1\n" * (1 << 20)})
    size = (4 << 20).to_bytes(4, "little")
    assert bomb.count(size) >= 1
    with pytest.raises(FormatError):
        ZIP.read("run.zip", bomb.replace(size, (64).to_bytes(4, "little")))


def test_an_encrypted_archive_is_refused_in_one_line() -> None:
    """The bit that says so is set in both headers."""
    data = bytearray(packed({"run.csv": b"t (s),y (m)\n0,1\n1,2\n2,3\n"}))
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(FormatError, match="encrypted"):
        ZIP.read("run.zip", bytes(data))


def test_a_file_without_a_name_is_damage() -> None:
    """An archive whose directory starts a name with a zero byte is refused in one line."""
    data = packed({"run.csv": b"t (s),y (m)\n0,1\n1,2\n2,3\n"})
    at = data.rindex(b"run.csv")
    with pytest.raises(FormatError, match="name"):
        ZIP.read("run.zip", data[:at] + b"\0" + data[at + 1 :])


def test_an_archive_of_several_runs_asks_which() -> None:
    """Pictures are passed over and named; each file is read as what it is."""
    csv, picture = b"Time (s),Position (m)\n0.0,0.1\n0.1,0.2\n0.2,0.4\n0.3,0.1\n", b"\x89PNG" + bytes(99)
    data = packed({"a.csv": csv, "b.txt": csv.replace(b",", b"\t"), "bench.png": picture, "__MACOSX/a.csv": csv})
    with pytest.raises(NeedsAnswer) as caught:
        ZIP.read("run.zip", data)
    assert caught.value.question.needs[0].choices == ("a.csv", "b.txt")
    recording = ZIP.read("run.zip", data, run="b.txt")
    assert recording.samples.distance.tolist() == [0.1, 0.2, 0.4, 0.1]


def test_noise_behind_the_mark_of_an_ole_file_is_one_line() -> None:
    """Whatever follows the first eight bytes."""
    for seed in range(8):
        noise = np.random.default_rng(seed).integers(0, 256, 2048, dtype=np.uint8).tobytes()
        with pytest.raises(FormatError, match="calamine"):
            WORKBOOK.read("run.xls", OLE + noise)


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


def dimensions(rows: int, columns: int, form: str = "<IIHHH") -> bytes:
    """Return the record in which a sheet states its size."""
    return record(0x200, struct.pack(form, 0, rows, 0, columns, 0))


@pytest.mark.parametrize("form", ["<IIHHH", "<HHHHH"])
def test_an_xls_that_states_too_many_cells_is_refused(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stated size is checked before a process is started, as BIFF8 and BIFF5 write it."""
    monkeypatch.setattr(sys, "executable", "none")
    with pytest.raises(FormatError, match=r"8388608 cells.*4294836225"):
        WORKBOOK.read("run.xls", xls(dimensions(65535, 65535, form) + SAMPLES))
    with pytest.raises(FormatError, match="134217728 bytes"):
        WORKBOOK.read("run.xls", OLE + bytes(sheets.MOST_BYTES))


def test_records_that_state_no_size_are_passed_over() -> None:
    """A sheet that states its size, and one whose records run beyond the end of the file, are left to calamine."""
    samples = WORKBOOK.read("run.xls", xls(dimensions(40, 2) + SAMPLES), unit="m").samples
    assert samples.distance.size == 40
    with pytest.raises(FormatError, match="calamine"):
        WORKBOOK.read("run.xls", OLE + bytes(600) + SHEET + record(0x225) * 600 + SHEET)


def tables_without_end() -> bytes:
    """Return an xls whose list of tables names itself as the next."""
    data = bytearray(xls(SAMPLES))
    data[68:72] = struct.pack("<I", 0)
    data[2 * 4096 - 4 : 2 * 4096] = bytes(4)
    return bytes(data)


LONG = record(0xFC, struct.pack("<II", 1, 1), struct.pack("<HB", 8000, 0), b"a" * 8000)
SHARING = b"".join(record(0xFD, struct.pack("<HHHI", i, 2, 0, 0)) for i in range(60000))
HOSTILE = {
    "a cell in the last row and column": xls(SAMPLES + number(65535, 65535, 1.0)),
    "every sheet at one place": xls(SAMPLES + number(65535, 30, 1.0), sheets=250),
    "a long string in many cells": xls(SAMPLES + SHARING, book=LONG),
    "tables without end": tables_without_end(),
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


@limited
def test_a_child_that_ends_early_is_named_with_its_status() -> None:
    """An allocation that fails ends the process; the line has the status and the first line of its words."""
    expected = r"^run.xls: .* status -?\d+ \(memory allocation of \d+ bytes"
    with pytest.raises(FormatError, match=expected):
        WORKBOOK.read("run.xls", HOSTILE["a cell in the last row and column"])


def test_a_child_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is named with the limit of time."""
    monkeypatch.setattr(sheets, "TIME_LIMIT_S", 1e-3)
    with pytest.raises(FormatError, match=r"^run.xls: .*0\.001 s"):
        WORKBOOK.read("run.xls", xls(SAMPLES))


def test_a_child_that_cannot_be_started_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where the program that runs Python is gone, say."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(FormatError, match=r"^run.xls: .*process"):
        WORKBOOK.read("run.xls", xls(SAMPLES))


def test_text_is_bounded() -> None:
    """Sheets whose cells have more letters together than they may are refused."""
    data = workbook({"A": cells("t (s)", "x (m)") + rows(TIMES, VALUES), "B": cells("a word")})
    texts = child.read_sheets(data, 1000)
    assert [name for name, _ in texts] == ["A", "B"]
    with pytest.raises(ValueError, match="too long"):
        child.read_sheets(data, sum(len(text) for _, text in texts) - 1)


def test_the_child_starts_anywhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Modules in the working directory are not those that it imports, and a worker of a pool may start one."""
    for name in ("json", "python_calamine", "acquisition"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    data = xls(SAMPLES)
    with ProcessPoolExecutor(1, get_context("fork" if sys.platform == "linux" else "spawn")) as pool:
        assert pool.submit(sheets._sheets, "run.xls", data).result() == sheets._sheets("run.xls", data)


class Standard:
    """A standard stream in memory."""

    def __init__(self, data: bytes = b"") -> None:
        self.buffer = io.BytesIO(data)


def test_what_the_child_writes_is_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sheets with their texts, or the reason why there are none."""
    monkeypatch.setattr(child, "_limit_memory", lambda _: None)
    monkeypatch.setattr(sys, "argv", ["child.py", "0", "1000"])
    answers = []
    for data in (workbook({"A": cells("t (s)") + rows(["@0.5"])}), b"PK\x03\x04"):
        out = Standard()
        monkeypatch.setattr(sys, "stdin", Standard(data))
        monkeypatch.setattr(sys, "stdout", out)
        child.main()
        answers.append(json.loads(out.buffer.getvalue()))
    assert answers[0] == {"sheets": [["A", "t (s)\n12:00:00\n"]]}
    assert list(answers[1]) == ["refused"]


def test_the_script_answers_by_itself() -> None:
    """It is run by its path, and what it refuses is an answer and no failure."""
    command = [sys.executable, "-P", child.__file__, str(sheets.MEMORY_BYTES), "1000"]
    done = subprocess.run(command, input=b"PK\x03\x04", capture_output=True, check=True)
    assert done.stdout.startswith(b'{"refused": ')
    assert done.stderr == b""
