"""The trade: bounds against the tests' own, reference methods against the truth, front and recommendation by hand."""

from __future__ import annotations

import itertools
import math
from types import ModuleType

import numpy as np
import pytest

from pipeline.errors import AnalysisError
from pipeline.numerics.estimate import Estimate
from pipeline.track import Track
from springmass.trade.drawing import front, trade_figure
from springmass.trade.measure import Row, Trade, measure, own_record
from springmass.trade.methods import Method, damped_sine, fft_peak, hilbert, references, tiers, zero_crossings
from springmass.trade.truth import HOSTILE, Truth, bounds, record


def clean(damping: float, seconds: float = 30.0) -> tuple[np.ndarray, np.ndarray, Truth]:
    """Return a record with a micrometre of noise, and its truth."""
    truth = Truth(seconds=seconds, noise_m=1e-6, damping_per_s=damping)
    return truth.times, record(truth, np.random.default_rng(2)), truth


@pytest.mark.parametrize(("seconds", "damping"), [(10.0, 0.0), (120.0, 0.01463)])
def test_bounds_are_those_of_the_tests(synthetic: ModuleType, seconds: float, damping: float) -> None:
    """The inverse Fisher information agrees with a derivation that shares no code."""
    truth = Truth(seconds=seconds, damping_per_s=damping)
    found = bounds(truth)
    each = []
    for phase in np.linspace(-math.pi, math.pi, 9)[:-1]:
        other = synthetic.Truth(omega=2 * math.pi * truth.frequency_hz, gamma=damping, phase=float(phase))
        each.append(synthetic.fisher_bounds(other, truth.times, truth.noise_m))
    mean = {name: math.sqrt(np.mean([b[name] ** 2 for b in each])) for name in ("omega", "amplitude", "gamma")}
    assert found["frequency"] == pytest.approx(mean["omega"] / (2 * math.pi), rel=1e-6)
    assert found["amplitude"] == pytest.approx(mean["amplitude"], rel=1e-6)
    assert found["damping_rate"] == pytest.approx(mean["gamma"], rel=1e-6)


def test_bounds_are_those_of_the_literature() -> None:
    """120 s at 0.3 mm: 8.6e-7 Hz, 0.011 mm and 5.4e-6 1/s, as tabulated; false echoes tell nothing."""
    found = bounds(Truth())
    assert found == {
        "frequency": pytest.approx(8.6e-7, rel=0.03),
        "amplitude": pytest.approx(1.1e-5, rel=0.03),
        "damping_rate": pytest.approx(5.4e-6, rel=0.03),
    }
    assert bounds(Truth(echoes=0.2))["frequency"] == pytest.approx(found["frequency"] / math.sqrt(0.8))


def test_records_are_as_described() -> None:
    """Noise, amplitude, offset and the share of echoes are what was asked for; a seed gives one record."""
    truth = Truth(noise_m=1e-3, damping_per_s=0.0, echoes=0.1)
    y = record(truth, np.random.default_rng(7))
    assert np.array_equal(y, record(truth, np.random.default_rng(7)))
    away = np.abs(y - truth.offset_m) > truth.amplitude_m + 6e-3
    assert np.mean(away) == pytest.approx(0.094, abs=0.01)  # the rest of the echoes lies within the swing
    assert np.sqrt(2 * np.var(y[~away])) == pytest.approx(truth.amplitude_m, rel=0.02)


@pytest.mark.parametrize("linear", [0.0, 0.0073])
def test_mixed_drag_follows_its_equation(linear: float) -> None:
    """The crests' rate of decay is linear plus quadratic times amplitude, and at the start what the truth says."""
    truth = Truth(seconds=200.0, noise_m=1e-9, damping_per_s=linear, quadratic_per_m_s=0.235)
    y = record(truth, np.random.default_rng(3)) - truth.offset_m
    turns = y[: y.size // 76 * 76].reshape(-1, 76)  # a period each, but for a thousandth
    amplitude, t = np.sqrt(2.0) * turns.std(axis=1), truth.times[: turns.size].reshape(turns.shape).mean(axis=1)
    rate = -np.gradient(np.log(amplitude), t)
    assert rate[1:-1] == pytest.approx(linear + 0.235 * amplitude[1:-1], rel=0.05)
    assert truth.damping_rate == linear + 0.235 * 0.05


def test_records_are_spoilt_as_described() -> None:
    """Crests end where they are clipped, steps are those asked for, the rest position ends where it drifted to, and a
    second line of its amplitude stands in the spectrum."""
    calm = {"noise_m": 1e-9, "damping_per_s": 0.0, "seconds": 60.0}
    rng = np.random.default_rng(8)
    assert record(Truth(**calm, clip_m=0.04), rng).max() == pytest.approx(0.26, abs=1e-12)
    steps = record(Truth(**calm, quantum_m=1e-3), rng) / 1e-3
    assert steps == pytest.approx(np.round(steps), abs=1e-9)
    drift = np.subtract(*(record(Truth(**calm, drift_m=by), np.random.default_rng(8)) for by in (2e-3, 0.0)))
    assert (drift[0], drift[-1]) == (0.0, pytest.approx(2e-3))
    t = Truth(**calm).times
    sideways = record(Truth(**calm, sideways_m=1e-3), rng) - 0.22
    wave = np.exp(-2j * math.pi * 0.6 * 1.3183 * t) * np.hanning(t.size)
    assert 4 * abs(wave @ sideways) / t.size == pytest.approx(1e-3, rel=0.02)
    assert set(HOSTILE) > {"1.6 periods", "20 % false echoes", "sideways mode of 1 mm"}


@pytest.mark.parametrize("damping", [0.0, 0.01463])
def test_methods_for_damped_motion_find_it(damping: float) -> None:
    """The tiers and the fit of a damped sine give frequency, amplitude and damping of a nearly perfect record."""
    t, y, truth = clean(damping)
    results = {method.name: method.run(Track.from_arrays(t, y)) for method in tiers(linear=True)}
    for name, found in {**results, "scipy": damped_sine(t, y)}.items():
        assert found["frequency"].value == pytest.approx(truth.frequency_hz, rel=1e-6), name
        assert found["amplitude"].value == pytest.approx(0.05, rel=1e-4), name
        assert found["damping_rate"].value == pytest.approx(damping, abs=2e-6), name


def test_rough_methods_are_as_rough_as_they_are() -> None:
    """Zero crossings and Hilbert come within 1e-4 of an undamped frequency, the interpolated line within 1e-3."""
    t, y, truth = clean(0.0, 30.3)
    assert zero_crossings(t, y)["frequency"].value == pytest.approx(truth.frequency_hz, rel=1e-4)
    assert hilbert(t, y)["frequency"].value == pytest.approx(truth.frequency_hz, rel=1e-4)
    assert hilbert(t, y)["amplitude"].value == pytest.approx(0.05, rel=0.01)
    assert fft_peak(t, y)["frequency"].value == pytest.approx(truth.frequency_hz, rel=1e-3)
    assert fft_peak(t, y)["amplitude"].value == pytest.approx(0.05, rel=0.02)


def test_zero_crossings_count_through_weak_swings() -> None:
    """Swings that vanish in the middle of a record are counted by the time that passes."""
    t = np.arange(6000) / 100
    y = 0.2 + 0.05 * np.cos(2 * math.pi * 1.25 * t) * np.where((t > 20) & (t < 40), 1e-3, 1.0)
    assert zero_crossings(t, y)["frequency"].value == pytest.approx(1.25, rel=1e-4)


def test_a_record_that_does_not_oscillate_is_given_up() -> None:
    """Zero crossings and tiers refuse what does not swing, in one line."""
    t = np.arange(50) / 100
    with pytest.raises(AnalysisError, match="three upward crossings"):
        zero_crossings(t, 0.2 + t)
    tier = tiers()[0]
    with pytest.raises(AnalysisError):
        tier.run(Track.from_arrays(np.arange(1000) / 100, np.full(1000, 0.2)))


def row(name: str, seconds: float, error: dict[str, float], failed: int = 0) -> Row:
    """Return a row of a measurement made by hand; tiers are named so."""
    kind = "tier" if name in ("fast", "standard", "best") else "reference"
    method = Method(name, name, kind, lambda _: {})  # type: ignore[arg-type]
    return Row(method, seconds, error, dict.fromkeys(error, 0.0), failed)


def trade(*rows: Row, seeds: int = 10_000) -> Trade:
    """Return a measurement of these rows."""
    return Trade(Truth(), seeds, {"frequency": 1.0, "amplitude": 1.0}, rows)


def test_beaten_means_slower_and_nowhere_better() -> None:
    """One is beaten by what is quicker and no less exact in all estimates, not by what estimates less or fails."""
    quick = row("quick", 1.0, {"frequency": 1.5})
    fast = row("fast", 2.0, {"frequency": 1.2, "amplitude": 1.3})
    best = row("best", 9.0, {"frequency": 1.0, "amplitude": 1.0})
    silly = row("silly", 10.0, {"frequency": 1.0, "amplitude": 1.1})
    lame = row("lame", 0.5, {"frequency": 0.9, "amplitude": 0.9}, failed=3)
    found = trade(quick, fast, best, silly, lame)
    assert [found.beaten(each) for each in found.rows] == [None, None, None, "best", None]


def test_the_quickest_tier_within_a_tenth_is_recommended() -> None:
    """Fast where it reaches 1.1 bounds, else standard, else whichever errs least."""
    fast, standard, best = (
        row(name, cost, {"frequency": error})
        for name, cost, error in (("fast", 1.0, 1.3), ("standard", 2.0, 1.08), ("best", 3.0, 1.0))
    )
    assert trade(fast, standard, best).recommended is standard
    quick = row("fast", 1.0, {"frequency": 1.1})
    assert trade(quick, standard, best).recommended is quick
    least = row("best", 3.0, {"frequency": 1.2})
    assert trade(fast, row("standard", 2.0, {"frequency": 1.25}), least).recommended is least
    assert trade(row("fast", 1.0, {"frequency": 1.0}, failed=1), standard, best).recommended is standard


def test_a_method_that_gives_up_is_counted() -> None:
    """Failures are counted, errors are over the bound, times are the least, and every record is told."""
    truth = Truth(seconds=5.0)

    def moody(track: Track) -> dict[str, Estimate]:
        if track.y[0] < 0.22:
            raise AnalysisError("no")
        return {"frequency": Estimate(truth.frequency_hz + 2 * bounds(truth)["frequency"], 0.0, "Hz")}

    ticks, done = itertools.count(), []
    method = Method("moody", "moody", "reference", moody)
    found = measure(truth, [method], 20, timer=lambda: float(next(ticks)), progress=done.append)
    (only,) = found.rows
    low = sum(record(truth, np.random.default_rng(seed))[0] < 0.22 for seed in range(20))
    assert only.failed == low
    assert 0 < low < 20
    assert only.error == {"frequency": pytest.approx(2.0)}
    assert only.bias == {"frequency": pytest.approx(2.0)}
    assert only.seconds == 1.0
    assert done == list(range(1, 21))


def test_an_own_record_says_why_a_method_gave_up() -> None:
    """The reason stands in the place of the estimates."""

    def never(_: Track) -> dict[str, Estimate]:
        raise AnalysisError("nothing\nto see")

    method = Method("never", "never", "reference", never)
    track = Track.from_arrays([0.0, 1.0], [0.0, 1.0])
    assert own_record(track, [method], timer=lambda: 0.0) == [(method, "nothing to see", 0.0)]


def test_gaps_are_bridged_for_references() -> None:
    """A missing distance keeps no reference method from its estimate."""
    t, y, truth = clean(0.0)
    y[100] = math.nan
    for method in [*tiers(), *references()]:
        assert method.run(Track.from_arrays(t, y))["frequency"].value == pytest.approx(truth.frequency_hz, rel=0.02)


def test_the_front_keeps_what_nothing_beats() -> None:
    """Quickest first; equal within a hundredth is not better, and what does not estimate the quantity is left out."""
    errors = {"a": 9.0, "b": 9.5, "c": 1.0, "d": 0.995, "e": 0.5}
    rows = [row(name, float(i), {"frequency": error}) for i, (name, error) in enumerate(errors.items(), 1)]
    edge = front([*rows[::-1], row("f", 0.5, {"amplitude": 1.0})], "frequency")
    assert [each.method.name for each in edge] == ["a", "c", "e"]


def test_the_figure_has_a_mark_for_every_method_that_estimates_a_quantity() -> None:
    """One panel a quantity, time in ms against error, and the Pareto front through what nothing beats."""
    quick, best = row("quick", 1e-3, {"frequency": 9.0}), row("best", 1e-2, {"frequency": 1.0, "amplitude": 2.0})
    figure = trade_figure(trade(quick, best))
    lines = [{line.get_label(): line.get_xydata().tolist() for line in panel.get_lines()} for panel in figure.axes]
    assert [panel.get_ylabel() for panel in figure.axes] == ["frequency error / bound", "amplitude error / bound"]
    assert lines[0]["quick"] == [[1.0, 9.0]]
    assert lines[0]["Pareto front"] == [[1.0, 9.0], [10.0, 1.0]]
    assert "quick" not in lines[1]
    assert lines[1]["best"] == [[10.0, 2.0]]
