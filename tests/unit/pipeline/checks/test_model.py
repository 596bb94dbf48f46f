"""A run that one model does not describe gives model_misfit, whatever the cause, and noise alone does not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.findings.finding import Finding
from pipeline.options import options_for
from pipeline.track import F8, Track

OMEGA, AMPLITUDE, RATE = 8.3, 0.05, 0.012
T: F8 = np.arange(3000) / 100.0
PLAIN: F8 = AMPLITUDE * np.exp(-RATE * T) * np.cos(OMEGA * T)


def analysed(x: F8, seed: int, tier: str = "standard") -> Analysis:
    """Return the analysis of displacements with white noise."""
    track = Track.from_arrays(
        np.arange(x.size) / 100.0, 0.3 + x + 3e-4 * np.random.default_rng(seed).standard_normal(x.size)
    )
    return analyse(track, options=options_for(tier))


def swaying(seed: int, tier: str = "standard") -> Analysis:
    """Return the analysis of a run whose phase swings to and fro once by 0.06 rad."""
    angle = OMEGA * T + 0.06 * np.sin(2.0 * np.pi * T / 25.0)
    return analysed(AMPLITUDE * np.exp(-RATE * T) * np.cos(angle), seed, tier)


def misfit(result: Analysis) -> Finding | None:
    """Return the finding on a model that does not fit."""
    found = [finding for finding in result.findings if finding.code == "model_misfit"]
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize("tier", ["fast", "standard", "best"])
def test_halves_that_differ_are_a_misfit(tier: str) -> None:
    """A phase that no model of the windows follows leaves halves that differ by more than four uncertainties."""
    finding = misfit(swaying(1, tier))
    assert finding is not None
    assert finding.severity == "warning"
    assert finding.values["halves"] > 4.0
    assert finding.values["rms_m"] > 1.5 * finding.values["noise_m"]


def test_a_slow_beat_is_a_misfit() -> None:
    """A second oscillation of 2 mm that beats slower than the run lasts is no damping law and no steady phase."""
    finding = misfit(analysed(PLAIN + 2e-3 * np.cos(1.012 * OMEGA * T + 2.1), 1))
    assert finding is not None
    assert finding.values["halves"] > 4.0


OTHER = 0.009 * np.cos(OMEGA * T + 1.0) + 0.01
ALTERNATING = {
    "rows of two runs": np.where(np.arange(T.size) % 2, PLAIN + OTHER, PLAIN),
    "rows of two bobs": np.where(np.arange(T.size) % 2, 0.02 + 0.04 * np.cos(9.3 * T), PLAIN),
    "two levels": PLAIN + 1e-3 * (np.arange(T.size) % 2),
    "hum of the mains": PLAIN + 2e-3 * np.sin(2.0 * np.pi * 49.98 * T),
}


@pytest.mark.parametrize("name", ALTERNATING)
def test_rows_that_alternate_are_a_misfit_by_colour(name: str) -> None:
    """Residuals that can be predicted from row to row are no noise."""
    finding = misfit(analysed(ALTERNATING[name], 3))
    assert finding is not None
    assert all(math.isfinite(value) for value in finding.values.values())


@pytest.mark.parametrize("step_m", [0.0, 1e-3], ids=["fine", "1 mm"])
def test_rows_written_twice_are_a_misfit(step_m: float) -> None:
    """Times that were counted over doubled rows make the phase wander: nothing silent comes of it."""
    rng = np.random.default_rng(7)
    rows = np.sort(np.r_[np.arange(T.size), rng.choice(T.size, T.size // 5, replace=False)])
    y = PLAIN + 3e-4 * rng.standard_normal(T.size)
    y = (np.round(y / step_m) * step_m if step_m else y)[rows]
    finding = misfit(analyse(Track.from_arrays(np.arange(rows.size) / 100.0, 0.3 + y)))
    assert finding is not None
    assert finding.values["rms_m"] > 1.5 * finding.values["noise_m"]


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_lost_rows_are_a_misfit(share: float) -> None:
    """Times that were counted while rows were lost make the phase wander."""
    kept = np.random.default_rng(5).random(T.size) >= share
    finding = misfit(analysed(PLAIN[kept], 3))
    assert finding is not None
    assert finding.values["rms_m"] > 1.5 * finding.values["noise_m"]


def test_noise_alone_is_no_misfit() -> None:
    """Of twenty plain runs none has a misfit."""
    assert [seed for seed in range(20) if misfit(analysed(PLAIN, seed))] == []


def test_a_frequency_that_follows_the_amplitude_is_no_misfit() -> None:
    """A frequency that falls with the square of the amplitude has a model and a finding."""
    size = AMPLITUDE * np.exp(-RATE * T)
    for seed in range(3):
        result = analysed(size * np.cos(OMEGA * T + 60.0 * np.cumsum(size**2) / 100.0), seed)
        assert "amplitude_dependent_frequency" in {finding.code for finding in result.findings}
        assert misfit(result) is None


def test_a_smooth_residual_shows_no_filter_of_the_sensor() -> None:
    """It has no white noise that a filter could have smoothed, so the amplitude is not taken for a filtered one."""
    t, rng = np.arange(540) / 60, np.random.default_rng(1)
    lines = np.exp(-((np.fft.rfftfreq(4096, 1 / 60) / 4.0) ** 2))
    smooth = np.fft.irfft(lines * (rng.standard_normal(2049) + 1j * rng.standard_normal(2049)))[: t.size]
    y = 0.3 + 0.083 * np.exp(-0.1 * t) * np.cos(5.5 * t) + 1e-3 * smooth / np.std(smooth)
    result = analyse(Track.from_arrays(t, y))
    assert "smoothed_sensor" not in {finding.code for finding in result.findings}
    assert result.estimates["amplitude"].u < 2e-3
