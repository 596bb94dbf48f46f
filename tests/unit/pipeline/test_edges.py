"""Records on which a single fit of the whole is wrong: gaps, lost rows and wide swings; truth from closed forms."""

import itertools
import math

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.analysis import Analysis
from pipeline.bench.scene import Scene
from pipeline.track import Track
from tests.sampling import sampled
from tests.synthetic import solved

NOISES, RATES, GAPS = (1e-4, 3e-4, 2e-3), (50, 100), (0.05, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0)


def codes(analysis: Analysis, *severities: str) -> set[str]:
    """Return the codes of the findings, of these severities if any are given."""
    return {each.code for each in analysis.findings if not severities or each.severity in severities}


def pulled(analysis: Analysis, period_s: float) -> float:
    """Return the error of the angular frequency in standard uncertainties of the recording, without the clock's."""
    omega = analysis.oscillation.phase.angular_frequency
    return (omega.value - 2.0 * math.pi / period_s) / omega.u


def with_gap(seed: int) -> tuple[Track, float]:
    """Return a record of one swing, or of two releases, with one gap, and its period."""
    rng = np.random.default_rng(1000 + seed)
    period_s, rate, size = rng.uniform(0.4, 1.8), rng.choice(RATES), rng.uniform(0.01, 0.08)
    decay, noise = rng.choice([0.0, 0.005, 0.015, 0.04]), rng.choice(NOISES)
    long_s = rng.uniform(8.0, 60.0)
    parts = [int(long_s * rate), int(long_s * rng.choice([0.15, 0.5, 1.0]) * rate)]
    rng.shuffle(parts)
    begin_s = parts[0] / rate + long_s * rng.choice(GAPS)
    times = [np.arange(parts[0]) / rate, begin_s + np.arange(parts[1]) / rate]
    phases, again = rng.uniform(0.0, 2.0 * math.pi, 2), rng.random() < 0.4
    swings = [
        size * np.exp(-decay * (t - t[0] * again)) * np.cos(2.0 * math.pi / period_s * (t - t[0] * again) + phase)
        for t, phase in zip(times, phases if again else phases[[0, 0]], strict=True)
    ]
    y = 0.4 + np.concatenate(swings)
    return Track.from_arrays(np.concatenate(times), y + noise * rng.standard_normal(y.size)), period_s


@pytest.mark.parametrize("seed", sampled(range(320), 12))
def test_no_gap_makes_the_period_wrong(seed: int) -> None:
    """One swing or two releases, with gaps from a twentieth of the part beside them to thirty times."""
    track, period_s = with_gap(seed)
    assert abs(pulled(analyse(track), period_s)) < 4.0


def damped(t: np.ndarray, seed: int = 1) -> np.ndarray:
    """Return a damped sine of 52 mm about 219 mm with a noise of 80 um."""
    swing = 0.052 * np.exp(-0.015 * t) * np.cos(2.0 * math.pi / 0.790066 * t)
    return np.asarray(0.219 + swing + 8e-5 * np.random.default_rng(seed).standard_normal(t.size))


@pytest.mark.parametrize("pause_s", [80.0, 600.0, 800.0, 1200.0])
def test_a_long_pause_is_named_with_the_part_beyond_it(pause_s: float) -> None:
    """Two releases of one bob in one file: one is analysed, and --from of the other is offered."""
    t = np.arange(3000) / 100
    analysis = analyse(Track.from_arrays(np.append(t, 30.0 + pause_s + t), np.append(damped(t), damped(t, 2))))
    assert codes(analysis, "warning", "error") == {"long_gap"}
    (finding,) = (each for each in analysis.findings if each.code == "long_gap")
    assert f"from {30.0 + pause_s:.2f} " in finding.advice
    assert analysis.estimates["amplitude"].value == pytest.approx(0.052, abs=3e-5)
    assert analysis.estimates["damping_rate"].value == pytest.approx(0.015, abs=1e-4)


@pytest.mark.parametrize("seed", sampled(range(12), 3))
@pytest.mark.parametrize("rate", RATES)
def test_lost_rows_are_named_and_covered(seed: int, rate: int) -> None:
    """Two per cent of the rows are lost, and the times are row numbers."""
    rng, n = np.random.default_rng(seed), 30 * rate
    y = damped(np.arange(n) / rate, seed)[rng.random(n) > 0.02]
    analysis = analyse(Track.from_arrays(np.arange(y.size) / rate, y))
    assert "lost_rows" in codes(analysis, "warning")
    # At 100 Hz some of sixty losses stay unseen, and bend the frequency.
    assert rate > 50 or not codes(analysis) & {"clipped", "smoothed_sensor", "amplitude_dependent_frequency"}
    period = analysis.estimates["period"]
    assert abs(period.value - 0.790066) < 2.0 * period.u
    assert 0.008 < period.u / period.value < 0.04


@pytest.mark.parametrize(
    ("quadratic", "degrees"), sampled(itertools.product((0.02, 0.0, 0.1), (45, 60, 75, 90, 30, 20)))
)
def test_a_wide_pendulum(quadratic: float, degrees: int) -> None:
    """The equation of motion is solved by scipy; nobody touches the bob, and the pivot is fixed."""
    t, square, start = np.arange(3000) / 50, (2.0 * math.pi / 1.2) ** 2, math.radians(degrees)
    angle, _ = solved(lambda _, x, v: -square * math.sin(x) - quadratic * v * abs(v) - 0.002 * v, start, t)
    angle += math.radians(0.1) * np.random.default_rng(degrees).standard_normal(t.size)
    step = math.radians(0.25)
    scene = Scene(pendulum_length_m=(9.81 / square, 1e-6))
    analysis = analyse(Track.from_arrays(t, step * np.round(angle / step), unit="rad"), scene)
    assert not codes(analysis) & {"touched", "phase_jump", "restarted", "handled"}
    assert degrees > 75 or "rest_drift" not in codes(analysis)
    amplitude, small = analysis.estimates["amplitude"], analysis.estimates["period_small_swings"]
    assert amplitude.value == pytest.approx(start, rel=0.01)
    assert abs(amplitude.value - start) < 4.0 * amplitude.u
    assert abs(small.value - 1.2) < 4.0 * small.u
    gravity = analysis.estimates["gravity"]
    assert gravity.value == pytest.approx(9.81, rel=0.01)
    assert abs(gravity.value - 9.81) < 4.0 * gravity.u


@pytest.mark.parametrize("degrees", [2, 5, 8])
def test_the_amplitude_of_a_small_pendulum_is_corrected_for(degrees: int) -> None:
    """T = 4 sqrt(l/g) K(sin A/2), whose change from the amplitude is below u of a short recording, gives g."""
    from scipy.special import ellipk

    t, start = np.arange(1000) / 50, math.radians(degrees)
    period = 4.0 * math.sqrt(1.0 / 9.81) * float(ellipk(math.sin(0.5 * start) ** 2))
    angle = start * np.cos(2.0 * math.pi * t / period) + 1e-4 * np.random.default_rng(degrees).standard_normal(t.size)
    analysis = analyse(Track.from_arrays(t, angle, unit="rad"), Scene(pendulum_length_m=(1.0, 1e-6)))
    gravity = analysis.estimates["gravity"]
    assert abs(gravity.value - 9.81) < 3.0 * gravity.u
    assert gravity.u < 2e-3


@pytest.mark.parametrize("step", sampled([0.35, 0.8, 0.2, 0.5]))
def test_steps_as_large_as_the_motion_are_part_of_the_uncertainties(step: float) -> None:
    """Amplitude, rest position and damping rate hold, and no law is rejected, for steps up to 0.8 of the amplitude."""
    t, amplitude, pulls = np.arange(3000) / 100, 0.03, []
    for seed in range(12):
        rng = np.random.default_rng([seed, 7])
        step_m, period_s, rate = amplitude * step, rng.uniform(0.6, 1.1), rng.uniform(0.005, 0.03)
        rest = 0.25 + rng.uniform(-0.5, 0.5) * step_m
        swing = amplitude * np.exp(-rate * t) * np.cos(2.0 * math.pi * t / period_s + rng.uniform(-3.0, 3.0))
        y = np.rint((rest + swing + 2e-4 * rng.standard_normal(t.size)) / step_m) * step_m
        analysis = analyse(Track.from_arrays(t, y))
        if "period" in analysis.estimates:
            truth = {"amplitude": amplitude, "offset": rest, "damping_rate": rate}
            pulls.append(
                [abs(analysis.estimates[name].value - x) / analysis.estimates[name].u for name, x in truth.items()]
            )
            assert "no_law_fits" not in codes(analysis)
    assert len(pulls) >= 4
    assert np.quantile(pulls, 0.9, axis=0).max() < 2.8


@pytest.mark.parametrize("seconds", [2.6, 3.4, 4.5, 6.0, 6.6])
@pytest.mark.parametrize("speed", [0.0, 0.02, 0.04])
def test_a_rest_that_moves_is_followed_in_a_few_periods(seconds: float, speed: float) -> None:
    """The period does not depend on it, and the drift is named; three periods show a straight line."""
    t = np.arange(0.0, seconds, 0.01)
    errors = []
    for phase in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        rng = np.random.default_rng([int(1000 * phase), int(10 * seconds)])
        y = 0.3 + speed * t + 0.05 * np.exp(-0.01 * t) * np.cos(2 * np.pi * t / 0.79 + phase)
        analysis = analyse(Track.from_arrays(t, y + 1e-3 * rng.standard_normal(t.size)))
        period = analysis.estimates["period"]
        errors.append((period.value - 0.79) / period.u)
        assert ("rest_drift" in {each.code for each in analysis.findings}) == (speed > 0.0)
    assert max(map(abs, errors)) < 4.0
