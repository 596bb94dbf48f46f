"""What is no oscillation gets no period, of whatever quantity; what oscillates and rests, or beats, is told so."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from acquisition.block import UNITS
from acquisition.recordings.identify import open_recording
from pipeline.analyse import Analysis, analyse
from pipeline.track import Track
from springmass.loading.loaded import Loaded
from tests.sampling import sampled

SEEDS = range(6)
SMALL = 0.03  # of the period: an uncertainty that a reader would believe
HEADINGS = ("position (m)", "x (mm)", "theta (rad)", "angle (deg)", "U (V)", "a (m/s^2)", "F (N)")
F8 = np.ndarray


def ride(rng: np.random.Generator, t: F8) -> F8:
    """Return the acceleration of a lift or a car: it starts, cruises and brakes, over rough ground."""
    step = float(t[1])
    pushes = np.repeat(rng.choice([0.0, 0.0, 1.0, -1.0], t.size) * rng.uniform(0.3, 3.0, t.size), 80)[: t.size]
    width = int(rng.uniform(0.1, 0.6) / step) + 1
    return np.asarray(
        np.convolve(pushes, np.ones(width) / width, "same") + rng.normal(0, rng.uniform(0.02, 0.3), t.size)
    )


def fall(rng: np.random.Generator, t: F8) -> F8:
    """Return the height of a thing that is let go and lies still."""
    since = np.maximum(t - rng.uniform(0.1, 0.7) * t[-1], 0.0)
    return np.asarray(np.maximum(rng.uniform(0.5, 2.0) - 4.905 * since**2, 0.0) + rng.normal(0, 1e-3, t.size))


def switching(rng: np.random.Generator, t: F8) -> F8:
    """Return a signal that is switched on and off at random."""
    turns = np.cumsum(rng.exponential(rng.uniform(0.5, 2.0), t.size))
    return np.asarray(rng.uniform(1, 5) * (np.searchsorted(turns, t) % 2) + rng.normal(0, 0.01, t.size))


def remembering(rng: np.random.Generator, t: F8) -> F8:
    """Return noise whose power falls with the frequency."""
    spectrum = rng.normal(size=t.size) + 1j * rng.normal(size=t.size)
    return np.fft.irfft(spectrum[: t.size // 2 + 1] / np.sqrt(np.arange(t.size // 2 + 1) + 1.0), t.size)


def double_pendulum(rng: np.random.Generator, t: F8) -> F8:
    """Return an angle of a double pendulum of equal arms, let go high up, in closed form as textbooks have it."""

    def rates(_: float, state: F8) -> list[float]:
        a, b, p, q = state
        d, pull = a - b, 2.0 - np.cos(a - b) ** 2
        along = -9.81 * (2.0 * np.sin(a) - np.sin(b) * np.cos(d)) - np.sin(d) * (q * q + p * p * np.cos(d))
        return [p, q, along / pull, np.sin(d) * (2.0 * p * p + 2.0 * 9.81 * np.cos(a) + q * q * np.cos(d)) / pull]

    start = [*rng.uniform(1.8, 3.0, 2), 0.0, 0.0]
    turned = solve_ivp(rates, (0.0, float(t[-1])), start, t_eval=t, rtol=1e-8, atol=1e-8).y[rng.integers(0, 2)]
    return np.asarray(turned + rng.normal(0, 0.005, t.size))


KINDS = (ride, fall, switching, remembering, double_pendulum)


@pytest.mark.trials
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_what_is_no_oscillation_gets_no_period(tmp_path: Path, kind: Callable[[np.random.Generator, F8], F8]) -> None:
    """Six files of each kind, of a quantity, size, rate and length at random: no period that anybody would believe."""
    believed = {}
    for seed in SEEDS:
        rng, draw = np.random.default_rng(seed), random.Random(seed)
        t = np.arange(int(rng.uniform(8.0, 40.0) * 50)) / 50.0
        y = kind(rng, t) * 10.0 ** rng.uniform(-2, 2)
        path = tmp_path / "run.csv"
        rows = (f"{a:.3f},{b:.6g}" for a, b in zip(t, y, strict=True))
        path.write_text("\n".join([f"t (s),{draw.choice(HEADINGS)}", *rows]), encoding="utf-8")
        recording = open_recording(path)
        found = analyse(Loaded(recording, recording.format).track)
        period = found.estimates.get("period")
        warnings = [each.code for each in found.findings if each.severity != "info"]
        if period is not None and period.u < SMALL * period.value and not warnings:
            believed[seed] = str(period)
    assert not believed


def told_modes(found: Analysis) -> list[float]:
    """Return the periods of two modes that an analysis names, ascending."""
    if "first_mode_period" in found.estimates:
        assert [each.code for each in found.findings][:1] == ["two_modes"]
        assert "period" not in found.estimates
        return sorted(found.estimates[f"{name}_mode_period"].value for name in ("first", "second"))
    (mode,) = (each.values for each in found.findings if each.code == "sideways_mode")
    return sorted([found.estimates["period"].value, 1.0 / mode["frequency_hz"]])


@pytest.mark.parametrize("ratio", sampled([1.02, 0.6, 1.25, 1.1, 1.4], 3))
@pytest.mark.parametrize("quantity", ["length", "angle"])
def test_two_modes_of_equal_strength_are_both_named(ratio: float, quantity: str) -> None:
    """Neither is the oscillation; both periods are given, to a thousandth."""
    t = np.arange(3000) / 50.0
    y = np.cos(5.0 * t) + np.cos(5.0 * ratio * t + 0.4) + 0.01 * np.random.default_rng(2).standard_normal(t.size)
    found = analyse(Track.from_arrays(t, 0.05 * y, unit=UNITS[quantity]))
    expected = sorted([2 * np.pi / 5.0, 2 * np.pi / (5.0 * ratio)])
    assert told_modes(found) == pytest.approx(expected, rel=1e-3)
