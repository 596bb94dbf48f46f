"""Table 1 on a pipe and on terminals of several widths."""

import pytest

from pipeline.numerics.estimate import Estimate
from springmass.terminal.style import TerminalStyle, concise, shown
from springmass.typeset import prefixed


@pytest.mark.parametrize(
    ("estimate", "short", "long"),
    [
        (Estimate(0.05145, 2e-5, "m"), "51.450(20) mm", "51.450 ± 0.020 mm"),
        (Estimate(8.36e-5, 9.6e-7, "m"), "83.60(96) µm", "83.60 ± 0.96 µm"),
        (Estimate(0.790066, 2.3e-5, "s"), "0.790066(23) s", "0.790066 ± 0.000023 s"),
        (Estimate(0.22137, 1.8e-4, "kg"), "221.37(18) g", "221.37 ± 0.18 g"),
        (Estimate(-8.36e-5, 9.6e-7, "1/s"), "−8.360(96) × 10⁻⁵ s⁻¹", "(−8.360 ± 0.096) × 10⁻⁵ s⁻¹"),
        (Estimate(2.0, 0.0, "m"), "2 m", "2 m"),
        (Estimate(float("nan"), 0.0, "m"), "nan ± 0 m", "nan ± 0 m"),
        (Estimate(1372.0, 44.0, ""), "1372(44)", "1372 ± 44"),
    ],
)
def test_quantities_read_as_people_write_them(estimate: Estimate, short: str, long: str) -> None:
    """A prefix that leaves 1 to 1000 in front of it, both ways to state u; a pipe gets SI."""
    style = TerminalStyle(True, True, False, 80)
    assert (concise(estimate, style), shown(estimate, style)) == (short, long)
    assert shown(estimate, TerminalStyle()).isascii()
    assert prefixed(estimate).value == pytest.approx(
        estimate.value * {"mm": 1e3, "µm": 1e6, "g": 1e3}.get(prefixed(estimate).unit, 1.0), nan_ok=True
    )
