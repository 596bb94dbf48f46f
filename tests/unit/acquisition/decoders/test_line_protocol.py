"""The line protocol is what its page of the reference says."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from acquisition.decoders.decoder import Identity
from acquisition.decoders.line_protocol import SETTINGS, LineProtocolDecoder, frame

ROOT = Path(__file__).resolve().parents[4]
PAGE = (ROOT / "docs" / "reference" / "line-protocol.md").read_text(encoding="utf-8")
GOOD = b"$R1,0,1000000,2040.75,2130,E*CCAA\n"


def section(title: str) -> str:
    """Return a section of the page."""
    result = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert result is not None
    return result[1]


def vectors() -> list[tuple[str, ...]]:
    """Return the rows of the page's table of vectors, without quotes."""
    table = section("Vectors").partition("Identifications")[0]
    rows = re.findall(r"^\| `(.*)` \|(.*)\|$", table, re.MULTILINE)
    return [(line, *(cell.strip().strip("`") for cell in remainder.split("|"))) for line, remainder in rows]


def number(cell: str) -> float:
    """Return a cell's number, NaN for a dash."""
    return math.nan if cell == "-" else float(cell)


def decode(data: bytes) -> tuple[list[tuple[float, ...]], dict[str, int]]:
    """Return sequence, device us, echo us, degC and flags of each reading, and the faults that were counted."""
    decoder = LineProtocolDecoder()
    r = decoder.feed(0, data)
    rows = [(*row[1:4], row.temperature_c, flag) for row, flag in zip(r, r.flags, strict=True)]
    return [tuple(map(float, row)) for row in rows], {k: v for k, v in decoder.faults.items() if v}


def body_of(**change: str) -> bytes:
    """Return a body with some fields changed."""
    parts = {"tag": "R1", "sequence": "5", "device": "50000", "echo": "2040.75", "celsius": "2130", "status": "E"}
    return ",".join((parts | change).values()).encode()


@pytest.mark.parametrize("vector", vectors(), ids=lambda row: row[0])
def test_a_vector_of_the_page_is_read_as_it_says(vector: tuple[str, ...]) -> None:
    """Fields, missing flag, fault."""
    line, *cells, missing, fault = vector
    end = b"\r\n"
    rows, faults = decode(line.encode() + end)
    if fault:
        assert rows == []
        assert faults == {fault: 1, "garbage_bytes": len(line) + len(end)}
        return
    expected = [*map(number, cells), float(missing == "yes")]
    np.testing.assert_array_equal(rows, [expected])
    assert faults == {}


def test_an_identification_of_the_page_is_read_as_it_says() -> None:
    """It is no reading and no fault."""
    table = section("Vectors").partition("Identifications")[2]
    rows = re.findall(r"^\| `(.*)` \|(.*)\|$", table, re.MULTILINE)
    assert len(rows) == 2
    for line, remainder in rows:
        decoder = LineProtocolDecoder()
        assert len(decoder.feed(0, line.encode() + b"\n")) == 0
        assert not any(decoder.faults.values())
        name, *numbers = (cell.strip() for cell in remainder.split("|"))
        settings = dict(zip(SETTINGS, map(int, numbers), strict=True))
        assert decoder.status.identity == Identity("springmass-rangefinder", "2.0.0", name, settings)


def test_what_the_device_says_of_readings_without_an_echo_is_counted() -> None:
    """By letter; a fault of the wiring is a complaint until a reading comes."""
    decoder = LineProtocolDecoder()
    for letter in "NBCFASZ":
        decoder.feed(0, frame(f"R1,1,1,,,{letter}".encode()))
        assert bool(decoder.status.complaint) == (letter in "AS")
    names = ("no_echo", "busy", "too_close", "too_far", "no_answer", "stuck", "other")
    assert decoder.status.conditions == dict.fromkeys(names, 1)
    decoder.feed(0, frame(b"R1,1,1,,,A"))
    assert "does not answer" in decoder.status.complaint
    decoder.feed(0, GOOD)
    assert decoder.status.complaint == ""


@pytest.mark.parametrize(
    "change",
    ["sequence=4294967296", "sequence=-1", "echo=20", "echo=-1.00", "celsius=2.1", "status=e", "status=E,1", "tag=R2"],
)
def test_a_sound_checksum_over_a_wrong_field_is_no_reading(change: str) -> None:
    """It may be a later version's; it is counted and not guessed at."""
    rows, faults = decode(frame(body_of(**dict([change.split("=")]))))
    assert rows == []
    assert faults.pop("unknown_record") == 1
    assert set(faults) == {"garbage_bytes"}


@pytest.mark.parametrize(
    "change",
    [{"status": "N"}, {"status": "B"}, {"status": "Z"}, {"echo": ""}, {"echo": "0.00"}, {"status": "N", "echo": ""}],
    ids=str,
)
def test_an_echo_that_no_e_vouches_for_is_missing(change: dict[str, str]) -> None:
    """Whatever number stands there; the row stays, with its sequence and time."""
    (row,), faults = decode(frame(body_of(**change)))
    assert row[:2] == (5, 50000)
    assert math.isnan(row[2])
    assert row[4] == 1
    assert faults == {}
