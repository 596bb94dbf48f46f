"""A record in another unit is the same record: times, period and damping stay, and amplitudes scale.

Factors that are powers of two change no rounding, so that what differs there is a threshold in some unit; powers of
ten are what units differ by.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import UNITS, Flag
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from pipeline.analyse import Analysis, analyse
from pipeline.track import Track
from tests.sampling import sampled
from tests.synthetic import Truth, noisy, times

TRUTH = Truth(gamma=0.0073, beta=0.235)
T = times(40.0)


def records() -> dict[str, np.ndarray]:
    """Return records of every kind of motion and trouble, in metres."""
    rng = np.random.default_rng(11)
    clean = noisy(TRUTH, T, 3e-4, 1)
    echoes = clean.copy()
    echoes[rng.integers(0, T.size, 150)] = rng.uniform(0.3, 1.5, 150)
    noise = rng.normal(0.0, 3e-4, T.size)
    return {
        "clean": clean,
        "exact": TRUTH.position(T),
        "echoes": echoes,
        "coarse": np.round(clean, 3),
        "clipped": np.minimum(clean, 0.25),
        "hardening": noisy(replace(TRUTH, kappa=40.0), T, 3e-4, 2),
        "friction": noisy(Truth(mu=2e-3), T, 3e-4, 3),
        "strong": 0.22 + 0.05 * np.exp(-0.6 * T) * np.cos(8.3 * T) + noise,
        "overdamped": 0.22 + 0.05 * np.exp(-T / 3.0) - 0.02 * np.exp(-3.0 * T) + 0.3 * noise,
        "drift": clean + 0.01 * (T / 40.0) ** 2 + 0.004 * (T > 21.0),
        "beats": clean + 0.004 * np.cos(6.1 * T),
        "still": 0.22 + noise,
        "walk": 0.22 + np.cumsum(noise),
    }


def track(y: np.ndarray, factor: float, quantity: str = "length") -> Track:
    """Return a record whose values are multiplied by a factor."""
    return Track.from_arrays(T, y * factor, unit=UNITS[quantity])


def same(found: Analysis, expected: Analysis, factor: float) -> None:
    """Compare two analyses, one of a record multiplied by a factor."""
    assert type(found.motion) is type(expected.motion)
    assert found.quality == expected.quality
    assert found.estimates.keys() == expected.estimates.keys()
    lengths = {"amplitude", "offset", "noise", "velocity_rms"}
    for name, one in found.estimates.items():
        other = expected.estimates[name]
        scale = factor if name in lengths else 1.0
        # A search ends within a ten-thousandth of a standard uncertainty, wherever rounding takes it.
        assert one.value == pytest.approx(scale * other.value, rel=1e-9, abs=1e-4 * scale * other.u), name
        assert one.u == pytest.approx(scale * other.u, rel=1e-4), name
    assert found.damping.selected == expected.damping.selected
    assert found.damping.admissible == expected.damping.admissible
    codes = [
        {each.code for each in one.findings} - {"implausible_motion", "implausible_distance", "implausible_sag"}
        for one in (found, expected)
    ]
    assert codes[0] == codes[1]


@pytest.mark.parametrize("kind", sampled(records(), 1))
def test_no_result_depends_on_the_unit(kind: str) -> None:
    """From a millionth to a million times as large nothing changes, and no time does of a length.

    A length may be larger than a bob can swing, which widens what follows from it; a voltage may not.
    """
    y = records()[kind]
    expected = analyse(track(y, 1.0, "voltage"))
    for factor in (1e-6, 1e-3, 2.0**-20, 2.0**20, 1e2, 1e6):
        same(analyse(track(y, factor, "voltage")), expected, factor)
    same(analyse(track(y, np.pi / 180.0, "angle")), analyse(track(y, 1.0, "angle")), np.pi / 180.0)
    for factor in (1e-6, 1e-2, 1e3):
        found = analyse(track(y, factor))
        for name in {"period", "damping_rate"} & expected.estimates.keys():
            other = expected.estimates[name]
            assert found.estimates[name].value == pytest.approx(other.value, rel=1e-9, abs=1e-4 * other.u)


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize("seed", sampled(range(6)))
def test_the_unit_that_is_answered_changes_no_time_and_no_flag(tmp_path: Path, seed: int, lost: bool) -> None:
    """A motion of any size that dies away has no lost target, and one that was lost is, in um as in m."""
    rng = np.random.default_rng(seed)
    t = np.arange(600) / 50.0
    size = 10.0 ** rng.uniform(-3, 3)
    y = size * (3.0 + np.exp(-rng.uniform(0.1, 1.0) * t) * np.cos(7.0 * t) + 0.003 * rng.standard_normal(t.size))
    if lost:
        y[300:330] = 60.0 * size
    path = tmp_path / "run.csv"
    path.write_text("t,y\n" + "\n".join(f"{a:.2f},{b:.6g}" for a, b in zip(t, y, strict=True)), encoding="utf-8")
    found = {
        unit: open_recording(path, ReadOptions(unit=unit, time_unit="s")).samples for unit in ("m", "cm", "mm", "um")
    }
    for unit, factor in (("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6)):
        np.testing.assert_array_equal(found[unit].t, found["m"].t)
        np.testing.assert_array_equal(found[unit].flags, found["m"].flags)
        np.testing.assert_allclose(found[unit].distance, factor * found["m"].distance, rtol=1e-12)
    flagged = np.flatnonzero(found["m"].flags & Flag.FALSE_ECHO.value)
    assert flagged.tolist() == (list(range(300, 330)) if lost else [])
