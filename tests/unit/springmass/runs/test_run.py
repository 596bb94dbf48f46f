"""A run in a notebook: values by name, summaries, figures, frames and datasets; nothing is lost on the way."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr

import springmass as sm


@pytest.fixture(scope="module")
def damped() -> sm.Run:
    """Return the analysis of the damped recording with its scene."""
    data = sm.sample_data()
    return sm.analyse(data / "damped_simulated_position.txt", scene=data / "damped.scene.toml")


@pytest.fixture(scope="module")
def still() -> sm.Run:
    """Return the analysis of a record in which nothing moves."""
    rng = np.random.default_rng(1)
    return sm.analyse((np.arange(1000) / 100, 0.2 + 1e-4 * rng.standard_normal(1000)))


@pytest.fixture
def pyplot(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Return pyplot without a window and without the figures of examples that ran before, closed at the end."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    yield pyplot
    pyplot.close("all")


def test_estimates_go_by_name_and_by_symbol(damped: sm.Run) -> None:
    """Estimates, the selected law's coefficients, and the parameters of any law."""
    assert damped["k"] == damped["spring_constant"]
    assert damped["T"] == damped["period"]
    assert damped["C_d"] == damped["drag_coefficient"]
    assert damped["gamma"].value == pytest.approx(0.0065, rel=0.01)
    fitted = damped.analysis.motion.damping.fits["quadratic"].joint["beta"]
    # The fit's own uncertainty, and the scale of the distances.
    assert damped["quadratic.beta"].value == pytest.approx(fitted.value, rel=1e-12)
    assert fitted.u < damped["quadratic.beta"].u < 1.01 * fitted.u
    assert damped["k"].value == damped.analysis.estimates["spring_constant"].value
    assert list(damped) == list(damped.keys()) == list(dict(damped.items()))
    assert len(damped) == len(damped.values())
    assert damped.get("T") == damped["T"]
    assert damped.get("mu") is None
    assert "gamma" in damped
    assert "T" in damped
    assert "mu" not in damped
    with pytest.raises(KeyError, match="mu"):
        damped["mu"]


def test_the_summary_fits_a_terminal(damped: sm.Run, still: sm.Run) -> None:
    """At most 15 lines of at most 79 characters, the period first, whatever the record."""
    for analysis in (damped, still):
        lines = repr(analysis).splitlines()
        assert len(lines) <= 15
        assert max(len(line) for line in lines) <= 79
        assert repr(analysis) == str(analysis)
    assert "0.790066(23)" in repr(damped)
    assert "no_oscillation" in repr(still)


def test_the_notebooks_summary_is_whole(damped: sm.Run, still: sm.Run) -> None:
    """Every element is closed; all quantities, laws and findings are in it, and no script."""
    for analysis, tables in ((damped, 2), (still, 1)):
        # Only an attribute without a value is HTML and no XML.
        page = ElementTree.fromstring(analysis._repr_html_().replace("<details open>", "<details>"))
        text = "".join(page.itertext())
        assert page.find(".//script") is None
        assert len(page.findall(".//table")) == tables
        assert all(finding.code in text for finding in analysis.findings)
        if analysis is damped:
            assert "0.790066 ± 0.000023 s" in text
            assert all(name in text for name in damped.analysis.motion.damping.fits)


def test_names_from_outside_are_escaped(tmp_path: Path) -> None:
    """A file's name is text in the summary, whatever it holds."""
    path = tmp_path / "<b onload=x>&.txt"
    path.write_bytes((sm.sample_data() / "undamped_simulated_position.txt").read_bytes())
    page = sm.analyse(path)._repr_html_()
    assert "&lt;b onload=x&gt;&amp;.txt" in page
    assert "<b onload" not in page


def test_figures_go_into_axes_of_ones_own(damped: sm.Run, pyplot: Any) -> None:
    """Each draws into the axes given and no others, and returns them, with labels on both."""
    for chart in ("position", "amplitude", "phase", "energy", "drag"):
        figure, (one, other) = pyplot.subplots(1, 2)
        assert damped.plot(chart, ax=one) is one
        assert one.get_xlabel()
        assert one.get_ylabel()
        assert one.has_data()
        assert not other.has_data()
        pyplot.close(figure)
    axes = damped.plot("amplitude")
    assert pyplot.get_fignums() == [axes.figure.number]
    with pytest.raises(sm.Error, match="no chart 'colour'"):
        damped.plot("colour")


def test_the_frame_of_estimates(damped: sm.Run, still: sm.Run) -> None:
    """A row an estimate and coefficient with what the budget says, and correlations where they are asked for."""
    frame = damped.to_dataframe()
    assert list(frame.index) == list(damped)
    assert frame.loc["gamma", "u"] == damped["gamma"].u
    assert frame.loc["period", "symbol"] == "T"
    np.testing.assert_allclose(frame.expanded, frame.coverage_factor * frame.u)
    assert frame.loc["gamma", "dof"] == damped.analysis.derived.budgets["gamma"].dof < 200.0
    wide = damped.to_dataframe(correlations=True)
    matrix = wide[[f"r({name})" for name in wide.index]].to_numpy()
    np.testing.assert_array_equal(matrix, matrix.T)
    assert wide.loc["period", "r(frequency)"] == pytest.approx(-1.0)
    assert list(still.to_dataframe(correlations=True).index) == ["offset", "noise"]
    assert still.to_dataframe().coverage_factor.isna().all()


def test_the_dataset_holds_the_run_and_goes_into_a_file(damped: sm.Run, still: sm.Run, tmp_path: Path) -> None:
    """Samples, windows, laws and estimates by name; netCDF gives back the same."""
    found = damped.to_dataset()
    np.testing.assert_array_equal(found.distance, damped.analysis.track.y)
    np.testing.assert_array_equal(found.quality, damped.loaded.samples.flags)
    np.testing.assert_array_equal(found.left_out, damped.analysis.flags)
    used = found.left_out == 0
    assert float(np.std((found.distance - found.fit)[used])) < 1e-4
    assert found.period.item() == damped["period"].value
    assert found.period.attrs == {"u": damped["period"].u, "units": "s"}
    best = found.law_amplitude.sel(law=damped.analysis.motion.damping.selected)
    assert float(abs(best - found.amplitude_of_window)[found.kept].max()) < 2e-4
    assert {"smoothed_velocity", "u_smoothed_velocity", "smoothed_acceleration"} <= set(found)
    for analysis, name in ((damped, "damped.nc"), (still, "still.nc")):
        analysis.to_dataset().to_netcdf(tmp_path / name, engine="h5netcdf")
        with xr.open_dataset(tmp_path / name, engine="h5netcdf", decode_times=False) as again:
            xr.testing.assert_equal(again.load(), analysis.to_dataset())


@pytest.fixture(scope="module")
def full(damped: sm.Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run file with calibration, scene and the original inside, as a recorder writes it."""
    path = tmp_path_factory.mktemp("runs") / "full.h5"
    sensor = {"family": "line-protocol", "calibration": {"speed_of_sound_m_per_s": 345.0, "u_scale": 2e-4}}
    loaded = replace(damped.loaded, provenance={**damped.loaded.provenance, "sensor": sensor})
    return sm.Run(loaded, damped.scene).save(path)


def test_nothing_is_lost_on_the_way(full: Path, tmp_path: Path) -> None:
    """Saved again, and by way of xarray and netCDF, every number stays the same to the last digit."""
    expected = sm.analyse(full)
    assert expected["A0"].u > 1e-5  # the uncertainty of the scale
    saved = sm.load(full).save(tmp_path / "again.h5")
    expected.dataset().to_netcdf(tmp_path / "samples.nc", engine="h5netcdf")
    expected.to_dataset().to_netcdf(tmp_path / "all.nc", engine="h5netcdf")
    files = [xr.open_dataset(path, engine="h5netcdf") for path in (full, tmp_path / "samples.nc", tmp_path / "all.nc")]
    for source in (saved, expected.loaded.path, *files, expected.dataset(), expected.to_dataset(), expected):
        found = sm.analyse(source)
        assert found.result["estimates"] == expected.result["estimates"]
        assert found.scene == expected.scene
        assert [f.code for f in found.findings] == [f.code for f in expected.findings]
    assert sm.load(saved).loaded.originals == sm.load(full).loaded.originals != ()
    for file in files:
        file.close()


def test_a_part_of_a_dataset_is_a_part_of_the_run(full: Path) -> None:
    """Selected by xarray or by from_s and to_s, the same samples give the same numbers."""
    part = sm.analyse(sm.load(full).dataset().sel(time=slice(10.0, 60.0)))
    assert part.result["estimates"] == sm.analyse(full, from_s=10.0, to_s=60.0).result["estimates"]


def test_a_run_without_oscillation_says_so(still: sm.Run) -> None:
    """It is not ok, and a result that it lacks is a KeyError with the reason."""
    assert not still.ok
    assert still.law is None
    with pytest.raises(KeyError, match="no estimate"):
        still["T"]


def test_loading_is_no_analysis() -> None:
    """What cannot be analysed is loaded all the same; the error comes when a result is asked for."""
    run = sm.load((np.arange(3) / 100, [0.2, 0.21, 0.2]))
    assert len(run.loaded.samples) == 3
    with pytest.raises(sm.Error):
        run["T"]
