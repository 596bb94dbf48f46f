"""A mode beside the main oscillation is found, measured and taken out; a record without one shows none."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.findings.finding import Finding
from pipeline.track import F8, Track
from tests.sampling import sampled
from tests.synthetic import Truth, noisy, times


def analysed(t: F8, beside: F8 | float, truth: Truth | None = None, sigma_m: float = 3e-4, seed: int = 1) -> Analysis:
    """Return the analysis of a run with a motion beside it."""
    return analyse(Track.from_arrays(t, noisy(truth or Truth(gamma=0.01463), t, sigma_m, seed) + beside))


def modes(found: Analysis) -> list[Finding]:
    """Return the findings on modes."""
    return [finding for finding in found.findings if finding.code == "sideways_mode"]


@pytest.mark.parametrize("frequency_hz", [0.8, 2.1])
@pytest.mark.parametrize("seconds", [20.0, 120.0])
def test_a_mode_is_measured(frequency_hz: float, seconds: float) -> None:
    """Frequency and amplitude of a steady mode are those put in."""
    t = times(seconds)
    (mode,) = modes(analysed(t, 5e-4 * np.cos(2 * np.pi * frequency_hz * t + 1.0)))
    assert mode.values["frequency_hz"] == pytest.approx(frequency_hz, abs=0.4 / seconds)
    assert mode.values["amplitude_m"] == pytest.approx(5e-4, rel=0.15)


@pytest.mark.parametrize("seed", sampled(range(5)))
@pytest.mark.parametrize(
    "truth", [Truth(), Truth(beta=0.3), Truth(gamma=0.0073, beta=0.235, kappa=-4.3)], ids=["none", "drag", "bent"]
)
@pytest.mark.parametrize("seconds", [10.0, 120.0])
def test_a_clean_record_shows_no_mode(truth: Truth, seconds: float, seed: int) -> None:
    """Whatever the damping law, and with a bent frequency, clean records show nothing."""
    assert modes(analysed(times(seconds), 0.0, truth, seed=seed)) == []


def test_a_perfect_sinusoid_shows_no_mode() -> None:
    """A record without noise has no mode."""
    assert modes(analysed(times(20.0), 0.0, Truth(), 0.0)) == []


def test_amplitudes_scatter_less_without_the_mode() -> None:
    """A beat of a millimetre, taken out, leaves the estimates nearly as sharp as without it, and true."""
    t = times(60.0)
    beating = analysed(t, 1e-3 * np.cos(5.0 * t), sigma_m=1e-4).estimates
    alone = analysed(t, 0.0, sigma_m=1e-4).estimates
    for name in ("period", "amplitude", "damping_rate"):
        assert beating[name].u < 1.5 * alone[name].u, name
        assert abs(beating[name].value - alone[name].value) < 2.0 * beating[name].u, name
