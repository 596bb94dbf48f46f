"""Numbers whose thousands are set apart are refused; decimal commas are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError
from acquisition.recordings.identify import open_recording
from tests.sampling import sampled

_VALUES = 1500 + 700 * np.cos(np.arange(200) * 0.1)


def _printed(value: float, group: str, point: str) -> str:
    return f"{value:,.1f}".replace(",", "\0").replace(".", point).replace("\0", group)


@pytest.mark.parametrize(
    ("group", "point"), [(",", "."), (".", ","), (" ", ","), ("'", "."), ("\xa0", ","), ("\u202f", ",")]
)
@pytest.mark.parametrize("heading", sampled(["Zeit (s);Weg (mm)\n", "", "t;x\n"]))
def test_marks_of_thousands_are_refused(tmp_path: Path, group: str, point: str, heading: str) -> None:
    """No way to set thousands apart gives numbers, whichever family reads them."""
    path = tmp_path / "run.csv"
    times = [f"{i / 100:.2f}".replace(".", point) for i in range(_VALUES.size)]
    rows = (f"{t};{_printed(x, group, point)}\n" for t, x in zip(times, _VALUES, strict=True))
    path.write_text(heading + "".join(rows), encoding="utf-8")
    with pytest.raises(FormatError):
        open_recording(path, unit=None if "(" in heading else "mm")


def test_thousands_in_quotes_are_refused_next_to_separating_commas(tmp_path: Path) -> None:
    """Excel writes 1328 mm as "1,328" between quotes: read as a decimal it would be a thousand times too small."""
    path = tmp_path / "run.csv"
    path.write_text("t (s),x (mm)\n" + "".join(f'{i / 50:.2f},"{x:,.0f}"\n' for i, x in enumerate(_VALUES)))
    with pytest.raises(FormatError):
        open_recording(path)


def test_a_comma_that_may_be_either_in_all_numbers_is_decimal_and_reported(tmp_path: Path) -> None:
    """Where semicolons separate and no other mark stands in the file."""
    path = tmp_path / "run.csv"
    path.write_text("".join(f"{i};1,{501 + i}\n" for i in range(40)), encoding="utf-8")
    recording = open_recording(path, unit="m", rate_hz=20.0)
    np.testing.assert_allclose(recording.samples.distance, 1.501 + 1e-3 * np.arange(40))
    assert "decimal_comma" in {trap.code for trap in recording.traps}
