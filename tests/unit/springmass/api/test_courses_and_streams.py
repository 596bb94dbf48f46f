"""Many runs in one table, estimates while samples arrive, and every recording in xarray."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import springmass as sm

DATA = sm.sample_data()
PAIR = [DATA / "undamped_simulated_position.txt", DATA / "damped_simulated_position.txt"]


def test_a_course_is_a_frame_with_errors_as_rows(tmp_path: Path) -> None:
    """A row a source in their order, with the numbers of an analysis, on any executor."""
    empty = tmp_path / "empty.txt"
    empty.touch()
    t = np.arange(1000) / 100
    sources = [*PAIR, empty, (t, np.full(t.size, 0.2))]
    frame = sm.batch(sources, accuracy="fast")
    assert list(frame["status"]) == ["ok", "ok", "failed", "no_oscillation"]
    assert "empty" in frame.loc[2, "error"]
    assert frame.loc[0, "period"] == sm.analyse(PAIR[0], accuracy="fast")["T"].value
    with ThreadPoolExecutor(2) as executor:
        pd.testing.assert_frame_equal(sm.batch(sources, executor=executor, accuracy="fast"), frame)


def test_a_source_without_a_name_is_a_row(tmp_path: Path) -> None:
    """A series has no name, and arrays that are too short say so; a scene that is not there stops the call."""
    t = np.arange(1000) / 100
    series = pd.Series(0.2 + 0.05 * np.cos(8.3 * t), index=pd.Index(t, name="time"))
    frame = sm.batch([series, (t[:3], t[:3])], accuracy="fast")
    assert list(frame["status"]) == ["ok", "failed"]
    assert list(frame["run"]) == ["", ""]
    assert "\n" not in frame.loc[1, "error"]
    with pytest.raises(sm.Error, match="nowhere"):
        sm.batch([series], tmp_path / "nowhere.toml")


def test_two_threads_give_the_numbers_of_one() -> None:
    """To the last bit."""
    alone = [sm.analyse(path).result["estimates"] for path in PAIR]
    with ThreadPoolExecutor(2) as executor:
        runs = list(executor.map(sm.analyse, PAIR))
    assert [run.result["estimates"] for run in runs] == alone
    assert [pickle.loads(pickle.dumps(run)).result["estimates"] for run in runs] == alone


def test_a_stream_gives_the_estimates_so_far() -> None:
    """Those of an analysis of the same samples, as often as a fortieth of their time allows, and of all at the end."""
    rng, stream, seen = np.random.default_rng(2), sm.Stream({"bob": {"mass_kg": 0.2}}), []
    t = np.arange(4000) / 100
    y = 0.2 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + 1e-4 * rng.standard_normal(t.size)
    for part in np.split(np.arange(t.size), 40):
        run = stream.push(t[part], y[part])
        assert run is not None
        seen.append(len(run.loaded.samples))
    assert seen[0] == 100
    assert seen == sorted(seen)
    assert seen[-1] > 2000
    so_far = sm.analyse((t[: seen[-1]], y[: seen[-1]]), {"bob": {"mass_kg": 0.2}}, accuracy="fast")
    assert run.result["estimates"] == so_far.result["estimates"]
    found, whole = stream.finish(), sm.analyse((t, y), {"bob": {"mass_kg": 0.2}}, accuracy="fast")
    assert found.result["estimates"] == whole.result["estimates"]
    assert sm.Stream().push([0.0], [0.2]) is None


def test_xarray_opens_every_recording_by_name(tmp_path: Path) -> None:
    """A text as its dataset; only run files are opened without a name."""
    found = xr.open_dataset(str(PAIR[1]), engine="springmass", drop_variables="quality")
    assert sm.analyse(found)["T"].value == sm.analyse(PAIR[1])["T"].value
    assert found["time"].attrs["units"] == "s"
    engine = xr.backends.list_engines()["springmass"]
    run = sm.load(PAIR[0]).save(tmp_path / "run.h5")
    found.to_netcdf(tmp_path / "other.h5", engine="h5netcdf")
    opened = [engine.guess_can_open(str(path)) for path in (run, PAIR[0], tmp_path / "other.h5")]
    assert opened == [True, False, False]
