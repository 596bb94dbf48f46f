"""Numbers, times and blocks in the forms that programs, locales and instruments write: a file in, samples out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import FormatError
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording

N = 60
T = np.arange(N) / 20
X = np.round(5.0 * np.cos(6.0 * T), 3)  # cm


def read(tmp_path: Path, text: str, **answers: str | float) -> Recording:
    """Read a text as a file."""
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8")
    return open_recording(path, ReadOptions.of(answers))


def table(times: Sequence[str], values: Sequence[str], mark: str = ";", head: str = "Time (s);Position (cm)") -> str:
    """Write two columns."""
    return "\n".join([head.replace(";", mark), *(f"{t}{mark}{x}" for t, x in zip(times, values, strict=True)), ""])


def holds(recording: Recording, t: np.ndarray = T, x: np.ndarray = X) -> None:
    """Check times, and values in cm."""
    np.testing.assert_allclose(recording.samples.t, t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.samples.distance, x / 100, rtol=0, atol=1e-9)


# Numbers

ARABIC = str.maketrans("0123456789.", "٠١٢٣٤٥٦٧٨٩٫")
PERSIAN = str.maketrans("0123456789.-", "۰۱۲۳۴۵۶۷۸۹٫−")
FORMS = {
    "minus sign": lambda x: f"{x:.3f}".replace("-", "−"),
    "en dash": lambda x: f"{x:.3f}".replace("-", "–"),
    "no-break space": lambda x: f"\xa0{x:.3f}",
    "thin space behind": lambda x: f"{x:.3f}\u2009",
    "accounting": lambda x: f"({-x:.3f})" if x < 0 else f"{x:.3f}",
    "sign behind": lambda x: f"{-x:.3f}-" if x < 0 else f"{x:.3f}",
    "Arabic": lambda x: f"\u061c{x:.3f}".translate(ARABIC),
    "Persian": lambda x: f"\u200e{x:.3f}".translate(PERSIAN),
    "Fortran": lambda x: f"{x:.6E}".replace("E", "D"),
    "minus sign in the exponent": lambda x: f"{x:.6E}".replace("-", "−"),
    "powers of ten": lambda x: f"{x:.6E}".replace("E", "×10^").replace("-", "−"),
    "decimal comma": lambda x: f"{x:.4f}".replace(".", ","),
}


@pytest.mark.parametrize("mark", [";", "\t"])
@pytest.mark.parametrize("form", FORMS)
def test_numbers_in_every_form_are_read(tmp_path: Path, form: str, mark: str) -> None:
    """The digits are unambiguous, so no row is lost and nothing is asked."""
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], [FORMS[form](x) for x in X], mark))
    holds(recording)
    assert not recording.malformed_rows


@pytest.mark.parametrize("head", ["Time (s);Position (cm)", "Time;Position\n(s);(cm)\n"])
@pytest.mark.parametrize("word", ["∞", "-∞", "OL", "OVER", "---", "#N/A", "inf", "9.9E37", "-9.91E+37", "1.99999E+101"])
def test_an_overload_is_a_missing_sample_wherever_it_stands(tmp_path: Path, word: str, head: str) -> None:
    """No row of numbers is preamble, even if the swing begins beyond the range."""
    gone = (np.arange(N) < 7) | (np.arange(N) % 9 < 2)
    cells = [word if lost else f"{x:.3f}" for x, lost in zip(X, gone, strict=True)]
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], cells, head=head))
    holds(recording, x=np.where(gone, np.nan, X))
    assert recording.info.quantum_m is not None
    assert recording.info.quantum_m < 1e-4


def test_a_word_of_a_kind_below_belongs_to_the_rows(tmp_path: Path) -> None:
    """An instrument's own word for a lost value does not end the table at its top."""
    cells = ["NO TARGET" if row in (0, 1, 30) else f"{x:.3f}" for row, x in enumerate(X)]
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], cells))
    assert len(recording.samples) == N
    assert np.isnan(recording.samples.distance[[0, 1, 30]]).all()


def test_whole_numbers_among_three_decimals(tmp_path: Path) -> None:
    """26.000 next to 27 is no thousand; 1.000 next to 950 may be one."""
    values = 26.5 + np.round(0.4 * np.cos(6.0 * T), 3)
    cells = ["27" if row == 20 else f"{x:.3f}" for row, x in enumerate(values)]
    millis = [str(round(1000 * t)) for t in T]
    recording = read(tmp_path, table(millis, cells, head="Time (ms);Position (cm)"))
    holds(recording, x=np.where(np.arange(N) == 20, 27.0, values))
    thousands = [f"{x:.0f}" if x < 1000 else f"{x / 1000:.3f}" for x in 1000 + 300 * np.cos(6.0 * T)]
    with pytest.raises(FormatError, match="thousands"):
        read(tmp_path, table(millis, thousands, head="Time (ms);Position (mm)"))


def test_numbers_that_are_all_in_brackets_are_not_negative(tmp_path: Path) -> None:
    """Brackets mean a sign only next to numbers without brackets."""
    with pytest.raises(FormatError):
        read(tmp_path, table([f"{t:.2f}" for t in T], [f"({x + 9:.3f})" for x in X], head="a;b"), rate_hz=20.0)
