"""What is refused by name, and what only looks like it and is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError, UnknownFormat
from acquisition.recordings.identify import open_recording

T = np.arange(400) / 50
ROWS = "".join(f"{t:.2f},{0.3 + 0.05 * np.cos(8.3 * t):.5f}\n" for t in T)


def test_thousands_of_a_spreadsheet_are_refused_next_to_separating_commas(tmp_path: Path) -> None:
    """Excel writes 1328 mm as "1,328" between quotes: read as a decimal it would be a thousand times too small."""
    path = tmp_path / "run.csv"
    x = 1500 + 300 * np.cos(8.3 * T)
    path.write_text("t (s),x (mm)\n" + "".join(f'{t:.2f},"{a:,.0f}"\n' for t, a in zip(T, x, strict=True)))
    with pytest.raises(FormatError, match="thousands"):
        open_recording(path)


@pytest.mark.parametrize(
    "preamble", ["range: [0, 10, 20, 30]\n", "calibration: [1.0, 0.02, 3.4e-5, 2]\n", "notes:\n - 1\n - 2\n - 3\n"]
)
def test_a_table_below_a_line_of_settings_is_read(preamble: str, tmp_path: Path) -> None:
    """One list above the table makes no YAML of it."""
    path = tmp_path / "run.csv"
    path.write_text(preamble + "t (s),x (m)\n" + ROWS)
    assert len(open_recording(path).samples.t) == T.size


def test_yaml_of_lists_is_refused_by_name(tmp_path: Path) -> None:
    """Its two lists would be strung together as one channel."""
    path = tmp_path / "run.yml"
    lists = (f"{name}:\n" + "".join(f"- {each:.3f}\n" for each in T) for name in ("x_data", "y_data"))
    path.write_text("type: xy\n" + "".join(lists))
    with pytest.raises(UnknownFormat, match="YAML"):
        open_recording(path)
