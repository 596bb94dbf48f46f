"""Real recordings, where they are at hand, give what was found of them by other means."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.track import Track

RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "recordings"
BARE = "AyushPandhi__Pandhi_Ayush_PHY224/position data.txt"
DISC = "AyushPandhi__Pandhi_Ayush_PHY224/damped position.txt"
OTHERS = (
    "pankaj9um__PHY224/undamped_point_data.txt",
    "pankaj9um__PHY224/undamped_point_data_set2.txt",
    "kamjha__PHY224/position_osc.txt",
)
TICK_M = 4.3e-5

pytestmark = pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/recordings")


def track_of(name: str) -> Track:
    """Read a MotionSensor.vi position file in plain Python, at its row numbers over 100 Hz."""
    rows = [line.split("\t") for line in (RECORDINGS / name).read_text("utf-8").splitlines() if line[:1].isdigit()]
    t = float(rows[0][0]) + np.arange(len(rows)) / 100.0
    y = np.array([float(row[1]) / 100.0 for row in rows])
    return Track(t, y, np.zeros(t.size, np.uint8), 100.0, quantum_m=TICK_M, stated_error_m=0.00239)


@lru_cache
def analysed(name: str) -> Analysis:
    """Analyse such a file."""
    return analyse(track_of(name))


@pytest.mark.parametrize("name", [BARE, DISC, *OTHERS])
def test_halves_of_a_run_agree_with_the_whole(name: str) -> None:
    """The period of either half lies within five uncertainties of the whole run's, real life included."""
    track = analysed(name).track
    whole = analysed(name).estimates["period"]
    middle = len(track) // 2
    for part in (slice(None, middle), slice(middle, None)):
        half = analyse(replace(track, t=track.t[part], y=track.y[part], flags=track.flags[part])).estimates["period"]
        assert abs(half.value - whole.value) <= 5.0 * np.hypot(half.u, whole.u)


@pytest.mark.parametrize("name", [BARE, DISC, *OTHERS])
def test_every_bob_swings_sideways(name: str) -> None:
    """Each run holds a second mode at 0.58 to 0.61 of the main frequency: a pendulum of 0.33 to 0.4 m, the bench's."""
    (mode,) = (finding for finding in analysed(name).findings if finding.code == "sideways_mode")
    main = analysed(name).estimates["frequency"].value
    assert [effect.included for effect in analysed(name).effects if effect.name == "sideways_mode"] == [True]
    frequency = mode.values["frequency_hz"]
    assert 0.58 < frequency / main < 0.61
    assert 0.33 < 9.81 / (2 * np.pi * frequency) ** 2 < 0.40


@pytest.mark.parametrize("name", [BARE, *OTHERS])
def test_clean_runs_come_down_to_their_own_noise(name: str) -> None:
    """With the mode put in the smooth model leaves at most 1.5 times the noise that fourth differences show."""
    result = analysed(name)
    fourth = np.diff(result.track.y, 4) / np.sqrt(70.0)
    assert result.estimates["noise"].value <= 1.5 * 1.4826 * np.median(np.abs(fourth))


@pytest.mark.parametrize("name", [BARE, "kamjha__PHY224/position_osc.txt", DISC])
def test_velocity_is_the_recorded_one(name: str) -> None:
    """LabVIEW's velocity is a difference over one sample; over five of them it is the fitted one within 4 %."""
    file = name.replace("position", "velocity")
    lines = (RECORDINGS / file).read_text("utf-8").splitlines()
    rows = [line.split("\t") for line in lines if line[:1].isdigit()]
    recorded = {round(float(row[0]), 3): float(row[1]) / 100.0 for row in rows}
    result = analysed(name)
    v = np.array([recorded.get(round(float(x), 3), np.nan) for x in result.track.t])
    found = result.oscillation.waveform.velocity
    # A backward difference belongs half a sample earlier; of the disc's run it holds the sideways swing too.
    middle = np.concatenate([[np.nan], 0.5 * (found[1:] + found[:-1])])
    five = np.convolve(np.where(result.flags == 0, v - middle, np.nan), np.ones(5) / 5.0, mode="same")
    swing = float(np.nanmedian(np.abs(found)))
    assert float(np.nanmedian(np.abs(five))) < 0.04 * swing


# The laboratory report that states 200.7 g bare and 217.6 g with the disc of 102 mm was made on such a bench; its
# spring's mass is not told, 10 g is an ordinary one's. The recordings are another student's.
REPORT_BARE = {"bob": {"mass_kg": {"value": 0.2007, "u": 5e-5}}, "spring": {"mass_kg": {"value": 0.010, "u": 0.002}}}
REPORT_DISC = REPORT_BARE | {
    "bob": {"mass_kg": {"value": 0.2176, "u": 5e-5}},
    "disc": {"diameter_m": {"value": 0.102, "u": 5e-4}},
}


def test_disc_drag_falls_with_amplitude() -> None:
    """The disc's drag coefficient is near 4 at 50 mm and near 8 at 15 mm, by the law and by slopes without one."""
    scene = Scene.from_mapping(REPORT_DISC | {"air": {"temperature_c": {"value": 21.0, "u": 2.0}}})
    curve = analyse(analysed(DISC).track, scene).drag_curve()
    assert curve is not None
    assert float(np.interp(0.050, curve.x, curve.y)) == pytest.approx(4.3, abs=0.6)
    assert float(np.interp(0.015, curve.x, curve.y)) == pytest.approx(7.8, abs=1.5)
    law = np.interp(curve.x_points, curve.x, curve.y)
    assert np.mean(np.abs(curve.y_points - law) < 2 * curve.u_points) > 0.8
