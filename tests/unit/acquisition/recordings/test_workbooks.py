"""Workbooks and archives: what cells, sheets and files inside become, and what is refused before it is unpacked."""

from __future__ import annotations

import importlib.util
import struct
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.families.workbook.compound import MAGIC, container_of
from acquisition.recordings.identify import get_format

WORKBOOK, ZIP = get_format("workbook"), get_format("zip")


@pytest.fixture(scope="module")
def writer() -> ModuleType:
    """Return the module that writes the files of the conformance suite."""
    path = Path(__file__).parents[3] / "conformance" / "test_formats.py"
    spec = importlib.util.spec_from_file_location("springmass_writers_of_formats", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


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


def test_a_time_of_the_day_counts_from_the_first(writer: ModuleType) -> None:
    """A cell with a time is a share of the day, whatever it shows."""
    told = [f"@{(86390 + i) % 86400 / 86400!r}" for i in range(20)]
    data = writer.workbook({"A": writer.cells("Time", "Position (m)") + rows(told, VALUES)})
    samples = WORKBOOK.read("run.xlsx", data).samples
    np.testing.assert_allclose(samples.t, np.arange(20.0), atol=1e-6)
    np.testing.assert_allclose(samples.distance, np.array(VALUES, float), rtol=1e-14)


def test_numbers_of_few_digits_beside_long_ones_are_not_taken_for_cut(writer: ModuleType) -> None:
    """A workbook keeps 0.3 and 0.30000000000000004 alike; no row is malformed and times are on their grid."""
    times = [repr(0.1 * i) for i in range(12)]
    values = [*(f"{0.2 + 0.01 * i:.2f}" for i in range(11)), "1"]
    recording = WORKBOOK.read("run.xlsx", writer.workbook({"A": writer.cells("t (s)", "y (cm)") + rows(times, values)}))
    assert recording.malformed_rows == 0
    assert recording.info.rate_hz == 10.0
    assert recording.samples.distance[-1] == 0.01


def test_several_sheets_are_runs_of_which_one_is_named(writer: ModuleType) -> None:
    """All that is missing is asked at once, and a sheet without times is told and passed over."""
    sheet = writer.cells("t (s)", "y") + rows(TIMES, VALUES)
    spectrum = writer.cells("Frequency (Hz)", "A") + rows(VALUES[::-1], VALUES)
    data = writer.workbook({"first": sheet, "second": sheet, "FFT": spectrum})
    with pytest.raises(NeedsAnswer, match=r'which of the 2 runs "first", "second", and what is y\'s unit'):
        WORKBOOK.read("run.xlsx", data)
    recording = WORKBOOK.read("run.xlsx", data, run="second", unit="m")
    assert recording.run == "second"
    assert 'no recording: sheet "FFT"' in {trap.message for trap in recording.traps}


@pytest.mark.parametrize(
    "far",
    [
        '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>',
        '<row r="4294967"><c r="ZZZZZZ4294967"><v>1</v></c></row>',
        "<row/>" * 9000 + "<row>" + "<c><v>1</v></c>" * 9000 + "</row>",
        '<x:row><x:c  t="n" r="XFD1048576"><v>1</v></x:c></x:row>',
    ],
)
def test_a_sheet_as_large_as_its_last_cell_says_is_refused(writer: ModuleType, far: str) -> None:
    """The reader of cells would reserve half a terabyte for two cells and end the process."""
    data = writer.workbook({"A": writer.cells("t (s)") + far})
    with pytest.raises(FormatError, match=r"expected sheets of at most \d+ cells, got \d+"):
        WORKBOOK.read("run.xlsx", data)


def test_what_unpacks_to_more_than_it_may_is_refused(writer: ModuleType) -> None:
    """A bomb is refused by the sizes that it states."""
    bomb = writer.packed({"run.csv": b"0,1\n" * (1 << 26)} | {"run2.csv": b"0"})
    assert len(bomb) < 1 << 20
    with pytest.raises(FormatError, match="expected at most 268435456 bytes unpacked, got"):
        ZIP.read("run.zip", bomb)


def test_a_bomb_that_lies_about_its_size_is_refused(writer: ModuleType) -> None:
    """No more is unpacked than is stated, and the check sum then fails."""
    bomb = writer.packed({"run.csv": b"0,1\n" * (1 << 20)})
    size = (4 << 20).to_bytes(4, "little")
    assert bomb.count(size) >= 1
    with pytest.raises(FormatError, match="cannot be unpacked"):
        ZIP.read("run.zip", bomb.replace(size, (64).to_bytes(4, "little")))


def test_an_encrypted_archive_is_refused_in_one_line(writer: ModuleType) -> None:
    """The bit that says so is set in both headers."""
    data = bytearray(writer.packed({"run.csv": b"t (s),y (m)\n0,1\n1,2\n2,3\n"}))
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(FormatError, match=r"cannot be unpacked.*encrypted"):
        ZIP.read("run.zip", bytes(data))


def test_a_file_without_a_name_is_damage(writer: ModuleType) -> None:
    """An archive whose directory starts a name with a zero byte is refused in one line."""
    data = writer.packed({"run.csv": b"t (s),y (m)\n0,1\n1,2\n2,3\n"})
    at = data.rindex(b"run.csv")
    with pytest.raises(FormatError, match=r"cannot be unpacked \(a file in it has no name\)"):
        ZIP.read("run.zip", data[:at] + b"\0" + data[at + 1 :])


def test_an_archive_of_several_runs_asks_which(writer: ModuleType) -> None:
    """Pictures are passed over and named; each file is read as what it is."""
    csv, picture = b"Time (s),Position (m)\n0.0,0.1\n0.1,0.2\n0.2,0.4\n0.3,0.1\n", b"\x89PNG" + bytes(99)
    data = writer.packed({"a.csv": csv, "b.txt": csv.replace(b",", b"\t"), "bench.png": picture, "__MACOSX/a.csv": csv})
    with pytest.raises(NeedsAnswer, match=r'which of the 2 runs "a.csv", "b.txt"\?'):
        ZIP.read("run.zip", data)
    recording = ZIP.read("run.zip", data, run="b.txt")
    assert recording.samples.distance.tolist() == [0.1, 0.2, 0.4, 0.1]


def test_noise_behind_the_mark_of_an_ole_file_is_one_line() -> None:
    """Whatever follows the first eight bytes."""
    for seed in range(40):
        noise = np.random.default_rng(seed).integers(0, 256, 2048, dtype=np.uint8).tobytes()
        with pytest.raises(FormatError, match="is no xls that can be read"):
            WORKBOOK.read("run.xls", MAGIC + noise)


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


def xls(cells: bytes, *, book: bytes = b"", sheets: int = 1) -> bytes:
    """Return an xls whose sheets are all at one place."""
    names = [record(0x85, struct.pack("<IBBBB", 0, 0, 0, 1, 0), bytes([65 + i % 26])) for i in range(sheets)]
    at = len(BOOK + book + b"".join(names) + END)
    names = [each[:4] + struct.pack("<I", at) + each[8:] for each in names]
    return container_of(BOOK + book + b"".join(names) + END + SHEET + cells + END)


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


def circle() -> bytes:
    """Return an xls whose stream follows itself without end."""
    data = bytearray(xls(SAMPLES))
    table = int.from_bytes(data[76:80], "little")
    data[(table + 1) * 4096 : (table + 1) * 4096 + 4] = bytes(4)
    return bytes(data)


def tables_without_end() -> bytes:
    """Return one whose list of tables names itself as the next."""
    data = bytearray(xls(SAMPLES))
    data[68:72] = struct.pack("<I", 0)
    data[2 * 4096 - 4 : 2 * 4096] = bytes(4)
    return bytes(data)


LONG = record(0xFC, struct.pack("<II", 1, 1), struct.pack("<HB", 8000, 0), b"a" * 8000)
HOSTILE = {
    "the last row and column": xls(SAMPLES + number(65535, 65535, 1.0)),
    "every sheet at one place": xls(SAMPLES + number(65535, 30, 1.0), sheets=250),
    "a long string in many cells": xls(
        SAMPLES + b"".join(record(0xFD, struct.pack("<HHHI", i, 2, 0, 0)) for i in range(60000)), book=LONG
    ),
    "more strings than bytes": xls(SAMPLES, book=record(0xFC, struct.pack("<II", 1, 2**31 - 1), b"\1\0\0a")),
    "a circle": circle(),
    "tables without end": tables_without_end(),
}
HARMLESS = {
    "dimensions": xls(record(0x200, struct.pack("<IIHHH", 0, 2**32 - 1, 0, 65535, 0)) + SAMPLES),
    "header": xls(SAMPLES)[:40] + b"\xff\xff\xff\x7f" * 2 + xls(SAMPLES)[48:],
}
PEAK = """
import resource, sys
from acquisition.errors import FormatError
from acquisition.recordings.identify import open_recording
for path in sys.argv[1:]:
    try:
        open_recording(path)
    except FormatError as error:
        print(str(error))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def peaks(tmp_path: Path, *files: bytes) -> list[str]:
    """Return what opening each file in one process says, and the most memory that it took until then."""
    paths = [tmp_path / f"{i}.xls" for i in range(len(files))]
    for path, data in zip(paths, files, strict=True):
        path.write_bytes(data)
    done = subprocess.run([sys.executable, "-c", PEAK, *map(str, paths)], check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout.splitlines()


@pytest.mark.skipif(sys.platform == "win32", reason="resource is of Unix")
def test_no_xls_takes_more_memory_than_its_cells(tmp_path: Path) -> None:
    """Each is refused in one line, or read without what it declares, within 64 MiB of what one that is sound takes."""
    unit = 1024 if sys.platform == "darwin" else 1
    before, *found = peaks(tmp_path, xls(SAMPLES), *HOSTILE.values(), *HARMLESS.values())[1:]
    messages, sizes = found[0 : 2 * len(HOSTILE) : 2], [int(each) for each in found[-1:]]
    assert max(sizes) / unit - int(before) / unit < 64 << 10
    words = (
        "cells, got 4294967296",
        "cells, got 507904000",
        "letters in cells, got",
        "strings in",
        "in a circle",
        "in a circle",
    )
    for message, word in zip(messages, words, strict=True):
        assert word in message
