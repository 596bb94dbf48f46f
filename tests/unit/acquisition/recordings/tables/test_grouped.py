"""Numbers whose thousands are set apart."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.errors import FormatError
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
