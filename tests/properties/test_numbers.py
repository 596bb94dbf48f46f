"""Numbers of a table are read to the last bit, and a row that is no row leaves its neighbours alone."""

import tempfile
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.recordings.identify import open_recording
from acquisition.recordings.recording import Recording


def printed(digits: int, decimals: int) -> str:
    """Return a number in fixed point."""
    return f"{Decimal(digits).scaleb(-decimals):f}"


FIXED = st.integers(0, 9).flatmap(
    lambda decimals: st.lists(
        st.integers(-(10**9), 10**9).map(lambda digits: printed(digits, decimals)), min_size=8, max_size=60
    )
)
EXPONENTS = st.lists(
    st.builds(
        lambda digits, power: f"{digits / 10**6:.6f}E{power}", st.integers(-(10**7), 10**7), st.integers(-30, 20)
    ),
    min_size=8,
    max_size=60,
)


def opened(folder: Path, heading: str, rows: list[str], newline: str = "\n") -> Recording:
    """Return what a file of these rows holds."""
    path = folder / "run.csv"
    path.write_bytes(newline.join([heading, *rows, ""]).encode())
    return open_recording(path)


@given(
    cells=st.one_of(FIXED, EXPONENTS),
    unit=st.sampled_from([("V", 0), ("mV", -3), ("m/s^2", 0)]),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_every_form_of_number_is_read_as_a_decimal_number(
    cells: list[str], unit: tuple[str, int], newline: str
) -> None:
    """Fixed point and the power of ten of the unit: rounded once, as decimals are; with an exponent, twice."""
    name, shift = unit
    with tempfile.TemporaryDirectory() as folder:
        rows = [f"{i / 100:.2f};{cell}" for i, cell in enumerate(cells)]
        samples = opened(Path(folder), f"t (s);y ({name})", rows, newline).samples
    for cell, value in zip(cells, samples.distance.tolist(), strict=True):
        exact = float(Decimal(cell).scaleb(shift))
        assert value == exact or ("E" in cell.upper() and value == pytest.approx(exact, rel=3e-16, abs=0.0))


@pytest.mark.parametrize("delimiter", ["\t", ";", "  "])
def test_a_file_of_many_pages_has_no_seams(tmp_path: Path, delimiter: str) -> None:
    """Rows are found as a whole wherever a page ends."""
    cells = [(f"{i / 100:.3f}", f"{25 + 6 * np.sin(8 * i / 100):.3f}") for i in range(40_000)]
    samples = opened(tmp_path, f"t[s]{delimiter}y[V]", [delimiter.join(pair) for pair in cells], "\r\n").samples
    assert samples.distance.tolist() == [float(cell) for _, cell in cells]
    np.testing.assert_allclose(samples.t, np.arange(40_000) / 100, rtol=1e-12)
