"""A bob that hits a stop is told from one that is touched, and from a plateau."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.track import Track

T = np.arange(3000) / 100
OMEGA, GAMMA = 8.3, 0.012


def struck(level: float, seed: int) -> np.ndarray:
    """Return displacements, m, of a bob that a stop throws back at 0.97 of its speed."""
    x, v, h, rows = 0.05 * np.cos(seed), -0.05 * OMEGA * np.sin(seed), 1e-3, []
    for k in range(10 * T.size):
        if k % 10 == 0:
            rows.append(x)
        v -= h * (OMEGA**2 * x + 2.0 * GAMMA * v)
        x += h * v
        if x < level:
            x, v = 2.0 * level - x, 0.97 * abs(v)
    return np.array(rows)


def analysed(y: np.ndarray, seed: int = 0) -> Analysis:
    """Return the analysis of distances with white noise."""
    return analyse(Track.from_arrays(T, y + 3e-4 * np.random.default_rng(seed).standard_normal(T.size)))


def codes(found: Analysis) -> set[str]:
    """Return the codes of its warnings."""
    return {finding.code for finding in found.findings if finding.severity != "info"}


@pytest.mark.parametrize(("sign", "end"), [(1.0, "near"), (-1.0, "far")])
def test_a_stop_is_named_with_its_place(sign: float, end: str) -> None:
    """The finding says at which end and where the bob turns, and the free part's numbers are right."""
    found = analysed(0.3 + sign * struck(-0.045, 1))
    told = next(finding.message for finding in found.findings if finding.code == "contact")
    assert f"at the {end} end" in told
    at_mm = float(told.split(" turns at ")[1].split(" mm")[0])
    assert at_mm == pytest.approx(300.0 - sign * 45.0, abs=1.0)
    assert not codes(found) & {"restarted", "touched", "phase_jump"}
    for name, true in (("period", 2.0 * np.pi / OMEGA), ("damping_rate", GAMMA)):
        assert abs(found.estimates[name].value - true) < 4.0 * found.estimates[name].u


def test_a_touch_is_no_stop() -> None:
    """Where amplitude and phase change at once, and both ends come nearer, the bob was touched."""
    size, phase = np.where(T < 9.0, 0.05, 0.035), np.where(T < 9.0, 0.0, 0.8)
    found = analysed(0.3 + size * np.exp(-GAMMA * T) * np.cos(OMEGA * T + phase))
    assert "touched" in codes(found)
    assert "contact" not in codes(found)
