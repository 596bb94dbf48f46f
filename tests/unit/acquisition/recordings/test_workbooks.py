"""Workbooks and archives: what cells, sheets and files inside become, and what is refused before it is unpacked."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
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
    with pytest.raises(FormatError, match="expected sheets of at most 8388608 cells, got"):
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


def test_an_archive_of_several_runs_asks_which(writer: ModuleType) -> None:
    """Pictures are passed over and named; each file is read as what it is."""
    csv, picture = b"Time (s),Position (m)\n0.0,0.1\n0.1,0.2\n0.2,0.4\n0.3,0.1\n", b"\x89PNG" + bytes(99)
    data = writer.packed({"a.csv": csv, "b.txt": csv.replace(b",", b"\t"), "bench.png": picture, "__MACOSX/a.csv": csv})
    with pytest.raises(NeedsAnswer, match=r'which of the 2 runs "a.csv", "b.txt"\?'):
        ZIP.read("run.zip", data)
    recording = ZIP.read("run.zip", data, run="b.txt")
    assert recording.samples.distance.tolist() == [0.1, 0.2, 0.4, 0.1]


def test_a_panic_of_the_reader_is_one_line(writer: ModuleType) -> None:
    """An OLE file cut anywhere is refused, whatever the reader stumbles over."""
    head = bytes.fromhex("d0cf11e0a1b11ae1")
    for seed in range(40):
        noise = np.random.default_rng(seed).integers(0, 256, 2048, dtype=np.uint8).tobytes()
        with pytest.raises(FormatError, match="calamine cannot read it"):
            WORKBOOK.read("run.xls", head + noise)
