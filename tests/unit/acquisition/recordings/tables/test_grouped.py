"""Numbers whose thousands are set apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError
from acquisition.recordings.identify import open_recording
from acquisition.recordings.tables.grouped import ungrouped

_VALUES = 1500 + 700 * np.cos(np.arange(200) * 0.1)


def _printed(value: float, group: str, point: str) -> str:
    return f"{value:,.1f}".replace(",", "\0").replace(".", point).replace("\0", group)


@pytest.mark.parametrize(
    ("group", "point"), [(",", "."), (".", ","), (" ", ","), ("'", "."), ("\xa0", ","), ("\u202f", ",")]
)
@pytest.mark.parametrize("mark", [";", "\t"])
def test_thousands_are_read_where_the_file_says_which_mark_is_which(group: str, point: str, mark: str) -> None:
    """Every way to set thousands apart gives the numbers that were printed, and leaves the times alone."""
    times = [f"{i / 100:.2f}".replace(".", point) for i in range(_VALUES.size)]
    rows = [f"{t}{mark}{_printed(x, group, point)}\n" for t, x in zip(times, _VALUES, strict=True)]
    page = "".join(rows).encode()
    take = ungrouped("a.csv", page, mark)
    assert take is not None
    read = [row.split(mark) for row in take(page).decode().splitlines()]
    assert [row[0] for row in read] == times
    np.testing.assert_allclose([float(row[1].replace(",", ".")) for row in read], _VALUES, atol=0.051)


def test_quoted_thousands_are_read_where_commas_separate() -> None:
    """A quoted cell may hold commas of thousands."""
    page = b'0.01,"1,234.5"\n0.02,999.5\n0.03,"1,001.0"\n'
    take = ungrouped("a.csv", page, ",")
    assert take is not None
    assert take(page).replace(b'"', b"") == b"0.01,1234.5\n0.02,999.5\n0.03,1001.0\n"


@pytest.mark.parametrize("page", [b"0.01;1,500\n0.02;1,498\n", b"0,01;1.500\n0,02;1.498\n"])
def test_what_may_be_thousands_or_decimals_is_refused(page: bytes) -> None:
    """A number that may be a thousand times another is asked about, and both marks are shown."""
    with pytest.raises(FormatError, match="may be thousands or decimals"):
        ungrouped("a.csv", page, ";")


@pytest.mark.parametrize(
    "page", [b"0,01;1,500\n0,02;1,498\n", b"0.01;1.500\n", b"0.12;-8,90E-4\n0.13;1,500\n", b"1;2 3\n", b"0.5;\n"]
)
def test_plain_numbers_are_left_alone(page: bytes) -> None:
    """Decimal commas, and decimal commas beside points, are no thousands."""
    assert ungrouped("a.csv", page, ";") is None


@pytest.mark.parametrize("heading", ["", "t;x\n", "Zeit (ms);Weg (mm)\n", "Zeit t / ms;s / mm\n"])
def test_the_families_take_thousands_as_every_table_does(tmp_path: Path, heading: str) -> None:
    """Steps of 50 that reach 1.000 beside 950: whole numbers, whichever family reads them."""
    path = tmp_path / "run.csv"
    times = [f"{50 * i:,}".replace(",", ".") for i in range(40)]
    path.write_text(heading + "".join(f"{t};{100 + i % 7}\n" for i, t in enumerate(times)), encoding="utf-8")
    said = {} if "(" in heading or "/" in heading else {"unit": "mm", "time_unit": "ms"}
    recording = open_recording(path, **said)  # type: ignore[arg-type]
    np.testing.assert_allclose(recording.samples.t, 0.05 * np.arange(40), atol=1e-12)


@pytest.mark.parametrize("heading", ["t;x\n", "Zeit (s);Weg (mm)\n"])
def test_the_families_refuse_what_may_be_either(tmp_path: Path, heading: str) -> None:
    """A point in the times and a comma before three digits in every value; or 999 beside 1,001."""
    path = tmp_path / "run.csv"
    for row in ("{t:.2f};1,{n}\n", "{i};{either}\n"):
        rows = (row.format(t=i / 20, i=i, n=501 + i, either=999 if i % 2 else "1,001") for i in range(40))
        path.write_text(heading + "".join(rows), encoding="utf-8")
        with pytest.raises(FormatError, match="may be thousands or decimals"):
            open_recording(path, unit="mm" if heading[0] == "t" else None)


def test_a_comma_that_may_be_either_in_all_numbers_is_decimal_and_told(tmp_path: Path) -> None:
    """Where semicolons separate and no other mark stands in the file."""
    path = tmp_path / "run.csv"
    path.write_text("".join(f"{i};1,{501 + i}\n" for i in range(40)), encoding="utf-8")
    recording = open_recording(path, unit="m", rate_hz=20.0)
    np.testing.assert_allclose(recording.samples.distance, 1.501 + 1e-3 * np.arange(40))
    assert [trap.message for trap in recording.traps if trap.code == "decimal_comma"] == [
        '"1,501" was read with a decimal comma: nothing in the file says that it is of thousands'
    ]
