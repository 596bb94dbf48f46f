"""``springmass.analyse`` takes what a user has in hand, with scene, laws, range and options by name."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import springmass as sm
from pipeline.errors import AnalysisError, TrackError
from springmass.errors import ProgramError


def record(gamma: float = 0.05) -> tuple[Any, Any]:
    """Return times and distances of a damped swing of 15 s."""
    t = np.arange(1500) / 100
    rng = np.random.default_rng(3)
    return t, 0.2 + 0.05 * np.exp(-gamma * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(t.size)


@pytest.fixture(scope="module")
def damped_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run file of the damped recording with its scene inside."""
    data = sm.sample_data()
    run = sm.load(data / "damped_simulated_position.txt", data / "damped.scene.toml")
    return run.save(tmp_path_factory.mktemp("runs") / "damped.h5")


def test_every_way_to_hand_over_arrays_gives_the_same_numbers() -> None:
    """A pair, a track, a dataset, a data array, a frame, a series and a mapping, by name or by index."""
    t, y = record()
    expected = sm.analyse((t, y)).analysis.estimates
    frame = pd.DataFrame({"time": t, "distance": y})
    array = xr.DataArray(y, {"time": t}, ["time"], attrs={"units": "m"})
    elapsed = pd.to_timedelta(t, unit="s")
    for source in (
        [t.tolist(), y.tolist()],
        {"time": t, "distance": y},
        frame,
        frame.set_index("time"),
        frame.set_index("time")["distance"],
        array,
        xr.Dataset({"distance": array}),
    ):
        assert sm.analyse(source).analysis.estimates == expected
    for source in (pd.Series(y, elapsed), pd.Series(y, pd.Timestamp("2026-11-22") + elapsed)):
        found = sm.analyse(source)["period"]
        assert abs(found.value - expected["period"].value) < 1e-6 * found.value


def test_arrays_have_no_path() -> None:
    """The result states none, also after a dataset, and an error names the arrays."""
    run = sm.analyse(record())
    assert run.result["input"]["path"] == ""
    assert sm.analyse(run.to_dataset()).result["input"]["path"] == ""
    with pytest.raises(sm.Error, match=r"^arrays: "):
        sm.analyse(record(), from_s=1e6)


@pytest.mark.parametrize("source", [3.0, None, {"t": [0.0]}, np.zeros(5), ([0.0, 1.0],), pd.DataFrame({"x": [1.0]})])
def test_what_holds_no_run_is_refused(source: Any) -> None:
    """Whatever it is, the error is the track's own."""
    with pytest.raises(TrackError):
        sm.analyse(source)


def test_the_scene_is_given_or_beside_the_file_or_in_it(damped_run: Path, tmp_path: Path) -> None:
    """In this order; a mapping is a scene too."""
    inside = sm.analyse(damped_run)
    assert inside["k"].value == pytest.approx(14.0, abs=0.05)
    copy = tmp_path / "copy.h5"
    copy.write_bytes(damped_run.read_bytes())
    (tmp_path / "copy.about.toml").write_text("[scene.bob]\nmass_kg = 0.1\n")
    assert sm.analyse(copy)["k"].value == pytest.approx(14.0 * 0.1 / 0.2213, rel=0.03)
    assert sm.analyse(copy, {"bob": {"mass_kg": 0.4}})["k"].value > 20.0
    (tmp_path / "copy.about.toml").write_text("[scene.bob]\nmass = 0.1\n")
    with pytest.raises(ProgramError, match=r"copy\.about\.toml \[scene\].*mass"):
        sm.analyse(copy)


def test_laws_are_chosen_by_name_or_given() -> None:
    """Of ``...`` all that ship are tried, each once; a law of one's own stands beside them."""
    t, y = record()

    def mine(t: Any, A0: float, c: float) -> Any:
        return A0 * np.exp(-c * t)

    law = sm.make_law("mine", mine, {"c": (0, -1)}, sm.LAWS["linear"].guess)
    assert list(sm.analyse((t, y), laws=["linear", "none"]).analysis.motion.damping.fits) == ["linear", "none"]
    found = sm.analyse((t, y), laws=["linear", ..., law])
    assert set(found.analysis.motion.damping.fits) == {*sm.LAWS, "mine"}
    assert found["mine.c"].value == pytest.approx(found["linear.gamma"].value, rel=1e-5)
    with pytest.raises(AnalysisError, match="got 'cubic'"):
        sm.analyse((t, y), laws=["cubic"])
    with pytest.raises(AnalysisError, match="laws"):
        sm.analyse((t, y), laws="linear")


def test_range_accuracy_and_options_go_by_name() -> None:
    """Seconds, tiers and options, and what is unknown lists what there is."""
    t, y = record()
    part = sm.analyse((t, y), from_s=5.0, to_s=12.0)
    assert (part.analysis.track.t[0], part.analysis.track.t[-1]) == (5.0, 12.0)
    assert sm.analyse((t, y), accuracy="best").how.options.rows == "samples"
    with pytest.raises(ProgramError, match="50"):
        sm.analyse((t, y), from_s=50.0)
    with pytest.raises(AnalysisError, match="accuracy"):
        sm.analyse((t, y), accuracy="quick")  # type: ignore[arg-type]
    with pytest.raises(TrackError, match="channel"):
        sm.analyse(sm.load((t, y)), channel="x")
    with pytest.raises(TrackError, match="channel"):
        sm.analyse((t, y), channel="x")


def test_runs_are_compared(damped_run: Path) -> None:
    """Paths and analyses together, with a scene for each or their own."""
    data = sm.sample_data()
    scene = data / "undamped.scene.toml"
    undamped = sm.analyse(data / "undamped_simulated_position.txt", scene)
    found = sm.compare([undamped, damped_run])
    frame = found.to_dataframe()
    assert list(frame.index) == ["undamped_simulated_position", "damped", "together"]
    assert found.comparison.agree
    assert frame.loc["together", "spring_constant"] == found.comparison.spring_constant.value
    assert frame.loc["damped", "period"] == found.runs["damped"]["period"].value
    assert "agree on k = 14.00" in repr(found)
    heavier = {"bob": {"mass_kg": 0.3}, "spring": {"mass_kg": {"value": 0.01, "u": 0.0005}}}
    other = sm.compare([undamped, undamped.dataset()], [None, heavier])
    assert list(other.runs) == ["undamped_simulated_position", "undamped_simulated_position-2"]
    assert not other.comparison.agree
    assert np.isnan(other.to_dataframe().loc["together", "spring_constant"])
    with pytest.raises(AnalysisError, match="got 1"):
        sm.compare([undamped])
    with pytest.raises(AnalysisError, match="got 3 for 2"):
        sm.compare([undamped, undamped], [scene] * 3)


def test_a_scale_that_may_drift_leaves_no_sound_damping_rate() -> None:
    """A sensor that warms by 1 % in a minute lets the amplitude fall faster; the period stays sound."""
    t, rng = np.arange(6000) / 100, np.random.default_rng(4)
    y = (0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.0 * t)) * (1.0 - 0.01 * t / 60) + 3e-4 * rng.standard_normal(t.size)
    grades = sm.analyse((t, y), unit="m").result["grades"]
    assert grades["period"]["grade"] == "sound"
    assert grades["damping_rate"] == {"grade": "uncertain", "reasons": ["rest_drift"]}
