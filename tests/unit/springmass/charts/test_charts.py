"""The numbers of every chart, as a browser gets them, are those of the analysis."""

import json
from typing import Any

import numpy as np
import pytest

import springmass as sm
from pipeline.analyse import Analysis, Oscillation
from pipeline.results.classic import classic
from pipeline.several.compare import SpringRun, compare_springs
from pipeline.track import F8
from springmass.charts.chart import Chart, ChartNote, Panel, Series, decoded, to_json
from springmass.charts.draw import render
from springmass.charts.run import charts_of
from springmass.charts.several import CourseValue, comparison, course, drag_map, overlay

DATA = sm.sample_data()


class Drawn:
    """A chart as charts.js reads it."""

    def __init__(self, chart: Chart) -> None:
        self.json: dict[str, Any] = json.loads(json.dumps(to_json(chart), allow_nan=False))

    def xy(self, label: str, panel: int = 0) -> tuple[F8, F8]:
        """Return x and y of the series whose label begins so."""
        found = self.series(label, panel)
        x = self.json["xs"][found["x"]]
        x = x["start"] + (decoded(x["after"]) if "after" in x else x["step"] * np.arange(x["count"]))
        return x, decoded(found["y"])

    def series(self, label: str, panel: int = 0) -> dict[str, Any]:
        """Return the first series whose label begins so."""
        found: dict[str, Any] = next(s for s in self.json["panels"][panel]["series"] if s["label"].startswith(label))
        return found


@pytest.fixture(scope="module")
def damped() -> Analysis:
    """Two minutes of a damped bob with false echoes in a known scene."""
    return sm.analyse(DATA / "damped_simulated_position.txt", scene=DATA / "damped.scene.toml").analysis


@pytest.fixture(scope="module")
def motion(damped: Analysis) -> Oscillation:
    """Its motion."""
    return damped.oscillation


@pytest.fixture(scope="module")
def charts(damped: Analysis) -> dict[str, Drawn]:
    """Its charts."""
    made = charts_of(damped, [ChartNote(2.0, "door", "mark")], classic(damped.track, damped.scene))
    return {name: Drawn(chart) for name, chart in made.items()}


def test_position(charts: dict[str, Drawn], damped: Analysis, motion: Oscillation) -> None:
    """Samples, those left out with their reasons, marks, fit and residuals over the noise."""
    t, y = charts["position"].xy("samples used")
    np.testing.assert_allclose(t, damped.track.t, atol=1e-6)
    used = np.isfinite(y)
    assert np.count_nonzero(used) == damped.quality["used"]
    np.testing.assert_allclose(y[used], 1e3 * damped.track.y[used], rtol=1e-6)
    out = charts["position"].series("left out")
    why = [out["words"][i] for i in out["why"]]
    assert len(why) == len(damped.track) - damped.quality["used"]
    assert sum("false echo" in each for each in why) == damped.quality["false_echo"] > 0
    assert charts["position"].series("marks")["words"] == ["door"]
    x, fit = charts["position"].xy("fit")
    np.testing.assert_allclose(np.interp(t[used], x, fit), 1e3 * motion.waveform.position[used], atol=1.0)
    _, residual = charts["position"].xy("residual", 1)
    assert np.nanstd(residual) == pytest.approx(1.0, abs=0.1)
    expected = (damped.track.y - motion.waveform.position) / damped.estimates["noise"].value
    np.testing.assert_allclose(residual[used], expected[used], atol=1e-3)


def test_amplitude(charts: dict[str, Drawn], damped: Analysis, motion: Oscillation) -> None:
    """The selected law begins at the amplitude of Table 1; every law that was fitted is a curve."""
    x, law = charts["amplitude"].xy(motion.damping.selected)
    assert law[0] == pytest.approx(1e3 * damped.estimates["amplitude"].value, rel=1e-5)
    assert x[0] == pytest.approx(motion.damping.t0)
    curves = [s for s in charts["amplitude"].json["panels"][0]["series"] if s["line"]]
    assert len(curves) == len(motion.damping.fits)
    assert next(s for s in curves if s["role"] == "law")["label"] == f"{motion.damping.selected} (selected)"
    _, y = charts["amplitude"].xy("amplitude of one window")
    kept = motion.damping.scatter.kept
    np.testing.assert_allclose(y, 1e3 * motion.windows.amplitude[kept], rtol=1e-6)
    np.testing.assert_allclose(
        decoded(charts["amplitude"].series("amplitude of one window")["u"]),
        1e3 * motion.damping.scatter.u[kept],
        rtol=1e-6,
    )
    _, residual = charts["amplitude"].xy("residual", 1)
    assert np.mean(residual**2) == pytest.approx(motion.damping.best.reduced_chi2, rel=0.3)


def test_frequency_and_spectrum(charts: dict[str, Drawn], damped: Analysis) -> None:
    """The frequency of the stretches and that of the highest peak are the one of Table 1."""
    _, shift = charts["frequency"].xy("a stretch of the run")
    u = decoded(charts["frequency"].series("a stretch of the run")["u"])
    assert abs(np.average(shift, weights=u**-2.0)) < 4.0 * np.sum(u**-2.0) ** -0.5
    f, whole = charts["spectrum"].xy("recording")
    assert f[np.argmax(whole)] == pytest.approx(damped.estimates["frequency"].value, abs=1.0 / 120.0)
    peaks, _ = charts["spectrum"].xy("peaks")
    assert peaks[0] == pytest.approx(damped.estimates["frequency"].value, abs=1.0 / 120.0)


def test_drag_and_energy(charts: dict[str, Drawn], damped: Analysis) -> None:
    """The energy begins at k A²/2; the drag is above its quadratic part."""
    start = 0.5e3 * damped.estimates["spring_constant"].value * damped.estimates["amplitude"].value ** 2
    _, law = charts["energy"].xy("law")
    assert law[0] == pytest.approx(start, rel=1e-3)
    _, drag = charts["drag"].xy("law")
    assert drag.min() > damped.estimates["drag_coefficient"].value


def test_motion_and_phase(charts: dict[str, Drawn], damped: Analysis) -> None:
    """Velocity and acceleration follow from amplitude and angular frequency; turns of the phase plot are ellipses."""
    omega, size = damped.estimates["angular_frequency"].value, damped.estimates["amplitude"].value
    _, velocity = charts["motion"].xy("velocity")
    assert np.sqrt(np.mean(velocity**2)) == pytest.approx(damped.estimates["velocity_rms"].value, rel=0.01)
    _, acceleration = charts["motion"].xy("acceleration", 1)
    assert np.max(acceleration) == pytest.approx(omega**2 * size, rel=0.02)
    labels = [series["label"] for series in charts["phase"].json["panels"][0]["series"]]
    turns = [charts["phase"].xy(label) for label in labels]
    for x, v in turns:
        assert np.max(np.abs(v)) / np.max(np.abs(x)) == pytest.approx(1e-3 * omega, rel=0.02)
        assert np.ptp(np.unwrap(np.arctan2(1e3 * v, omega * x))) == pytest.approx(2 * np.pi, rel=0.02)
    assert len(set(labels)) == len(labels) > 2
    assert np.max(turns[0][0]) > np.max(turns[-1][0])


def test_several_runs(damped: Analysis) -> None:
    """Positions from rest, spring constants and their pulls, and a quantity of a course by run."""
    over = overlay(["a", "b"], [damped, damped])
    assert over is not None
    _, y = Drawn(over).xy("a")
    assert np.max(np.abs(y)) == pytest.approx(1e3 * damped.estimates["amplitude"].value, rel=0.1)
    runs = [SpringRun.of(name, damped.derived, clock=damped.track.clock) for name in ("a", "b")]
    found = compare_springs(runs, spring_mass_kg=damped.scene.spring_mass_kg, mass_correlation=0.0)
    chart = Drawn(comparison(found))
    _, k = chart.xy("spring constant")
    np.testing.assert_allclose(k, [each.value for each in found.each], rtol=1e-6)
    np.testing.assert_allclose(chart.xy("residual", 1)[1], found.pulls, atol=1e-6)
    rows = [CourseValue("x", "A", 0.8, 0.1), CourseValue("z", "B", 90.0, 0.2), CourseValue("y", "A", 0.9, 0.2)]
    many = Drawn(course("period / s", "group", rows, {"z": "far from the others"}))
    x, period = many.xy("value")
    assert period == pytest.approx([0.8, 0.9])
    assert list(np.round(x)) == [1.0, 1.0]
    assert many.json["panels"][0]["names"] == ["A", "B"]
    assert many.json["panels"][0]["range"][1] < 2.0


def test_a_map_of_drag() -> None:
    """A line for each disc against both numbers, the gap between its runs kept."""
    points = np.array([[100.0, 1.0, 3.0, 0.1], [200.0, 2.0, 2.5, 0.1]])
    chart = drag_map([("10 cm", points), ("10 cm", 2.0 * points)])
    assert chart is not None
    found = Drawn(chart)
    for panel, column in enumerate((0, 1)):
        x, y = found.xy("disc 10 cm", panel)
        np.testing.assert_allclose(x[:2], points[:, column])
        np.testing.assert_allclose(y[:2], points[:, 2], rtol=1e-6)
        assert np.isnan(y[2])
    assert drag_map([("", np.zeros((0, 4)))]) is None


def test_a_long_series_keeps_its_extremes() -> None:
    """Thinned, a single false echo among a hundred thousand samples is still there."""
    y = np.sin(np.arange(100_000.0))
    y[54_321] = 9.0
    chart = Chart("long", "", "", (Panel("y", (Series("y", np.arange(100_000.0), y),)),))
    x, drawn = Drawn(chart).xy("y")
    assert drawn.size <= 12_500
    assert drawn.max() == 9.0
    assert x[np.argmax(drawn)] == 54_321.0


@pytest.mark.parametrize("name", ["position", "comparison"])
def test_text_from_outside_is_no_mathematics_in_a_figure(name: str) -> None:
    """A name between dollar signs is drawn as it is, whatever backend the user has set."""
    bad = r"$\frac{1}$"
    series = Series(bad, np.arange(3.0), np.arange(3.0), "mark", why=(bad, bad, bad))
    panel = Panel("y", (series, Series("b", np.arange(3.0), np.arange(3.0))), names=(bad, bad, bad))
    assert b"frac" in render(Chart(name, bad, "", (panel,)), ("svg",))["svg"]
