"""An analysis in a notebook: estimates by name, summaries, figures, frames and datasets."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import springmass as sm


@pytest.fixture(scope="module")
def damped() -> sm.Analysis:
    """Return the analysis of the damped recording with its scene."""
    data = sm.sample_data()
    return sm.analyse(data / "damped_simulated_position.txt", scene=data / "damped.scene.toml")


@pytest.fixture(scope="module")
def still() -> sm.Analysis:
    """Return the analysis of a record in which nothing moves."""
    rng = np.random.default_rng(1)
    return sm.analyse((np.arange(1000) / 100, 0.2 + 1e-4 * rng.standard_normal(1000)))


@pytest.fixture
def pyplot(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Return pyplot without a window, closed at the end."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_estimates_go_by_name_and_by_symbol(damped: sm.Analysis) -> None:
    """Estimates, the selected law's coefficients, and the parameters of any law."""
    assert damped["k"] == damped["spring_constant"]
    assert damped["T"] == damped["period"]
    assert damped["C_d"] == damped["drag_coefficient"]
    assert damped["gamma"].value == pytest.approx(0.0065, rel=0.01)
    fitted = damped.motion.damping.fits["quadratic"].joint["beta"]
    # The fit's own uncertainty, and the scale of the distances.
    assert damped["quadratic.beta"].value == pytest.approx(fitted.value, rel=1e-12)
    assert fitted.u < damped["quadratic.beta"].u < 1.01 * fitted.u
    assert damped["k"].value == damped.estimates["spring_constant"].value
    assert list(damped) == list(damped.keys()) == list(dict(damped.items()))
    assert len(damped) == len(damped.values())
    assert damped.get("T") == damped["T"]
    assert damped.get("mu") is None
    assert "gamma" in damped
    assert "T" in damped
    assert "mu" not in damped
    with pytest.raises(KeyError, match="mu"):
        damped["mu"]


def test_estimates_calculate_with_their_correlations(damped: sm.Analysis) -> None:
    """A product of estimates of one run is as certain as what they share allows."""
    assert (damped["period"] * damped["frequency"]).std_dev < 1e-12
    assert (damped["period"] * 2).std_dev == pytest.approx(2 * damped["period"].u)
    assert damped["k"].nominal_value == damped["k"].value
    assert ((2 * np.pi / damped["T"]) - damped["omega"]).std_dev < 1e-9


def test_the_summary_fits_a_terminal(damped: sm.Analysis, still: sm.Analysis) -> None:
    """At most 15 lines of at most 79 characters, the period first, whatever the record."""
    for analysis in (damped, still):
        lines = repr(analysis).splitlines()
        assert len(lines) <= 15
        assert max(len(line) for line in lines) <= 79
        assert repr(analysis) == str(analysis)
    assert "0.790066(23)" in repr(damped)
    assert "no_oscillation" in repr(still)


class Elements(HTMLParser):
    """Collects the elements of a page, and holds that each that is opened is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        """Note an element that is opened."""
        self.open.append(tag)
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Demand that it is the last one opened."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Note its text."""
        self.text += data


def test_the_notebooks_summary_is_whole(damped: sm.Analysis, still: sm.Analysis) -> None:
    """Every element is closed; all quantities, laws and findings are in it, and no script."""
    for analysis, tables in ((damped, 2), (still, 1)):
        page = Elements()
        page.feed(analysis._repr_html_())
        page.close()
        assert page.open == []
        assert "script" not in page.seen
        assert page.seen.count("table") == tables
        assert all(finding.code in page.text for finding in analysis.findings)
        if analysis is damped:
            assert "0.790066 ± 0.000023 s" in page.text
            assert all(name in page.text for name in damped.motion.damping.fits)


def test_names_from_outside_are_escaped(tmp_path: Path) -> None:
    """A file's name is text in the summary, whatever it holds."""
    path = tmp_path / "<b onload=x>&.txt"
    path.write_bytes((sm.sample_data() / "undamped_simulated_position.txt").read_bytes())
    page = sm.analyse(path)._repr_html_()
    assert "&lt;b onload=x&gt;&amp;.txt" in page
    assert "<b onload" not in page


def test_figures_go_into_axes_of_ones_own(damped: sm.Analysis, pyplot: Any) -> None:
    """Each draws into the axes given and no others, and returns them, with labels on both."""
    for draw in (damped.plot, damped.plot.amplitude, damped.plot.phase, damped.plot.energy, damped.plot.drag):
        figure, (one, other) = pyplot.subplots(1, 2)
        assert draw(ax=one) is one
        assert one.get_xlabel()
        assert one.get_ylabel()
        assert one.has_data()
        assert not other.has_data()
        pyplot.close(figure)
    axes = damped.plot.amplitude(laws=["linear", "linear+quadratic"])
    assert pyplot.get_fignums() == [axes.figure.number]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(label.split(" (")[0] for label in labels if "(" in label) == [
        "exponential, linear drag",
        "linear+quadratic",
    ]
    position = damped.plot.position(from_s=5.0, to_s=8.0)
    assert position.get_xlim() == (5.0, 8.0)


def test_the_frame_of_estimates(damped: sm.Analysis, still: sm.Analysis) -> None:
    """A row an estimate and coefficient with what the budget says, and correlations where they are asked for."""
    frame = damped.to_dataframe()
    assert list(frame.index) == list(damped)
    assert frame.loc["gamma", "u"] == damped["gamma"].u
    assert frame.loc["period", "symbol"] == "T"
    np.testing.assert_allclose(frame.expanded, frame.coverage_factor * frame.u)
    assert frame.loc["gamma", "dof"] == damped.motion.derived.budgets["gamma"].dof < 200.0
    wide = damped.to_dataframe(correlations=True)
    matrix = wide[[f"r({name})" for name in wide.index]].to_numpy()
    np.testing.assert_array_equal(matrix, matrix.T)
    assert wide.loc["period", "r(frequency)"] == pytest.approx(-1.0)
    assert list(still.to_dataframe(correlations=True).index) == ["offset", "noise"]
    assert still.to_dataframe().coverage_factor.isna().all()


def test_the_dataset_holds_the_run_and_goes_into_a_file(
    damped: sm.Analysis, still: sm.Analysis, tmp_path: Path
) -> None:
    """Samples, windows, laws and estimates by name; netCDF gives back the same."""
    found = damped.to_dataset()
    np.testing.assert_array_equal(found.distance, damped.track.y)
    np.testing.assert_array_equal(found.quality, damped.flags)
    used = found.quality == 0
    assert float(np.std((found.distance - found.fit)[used])) < 1e-4
    assert found.period.item() == damped["period"].value
    assert found.period.attrs == {"u": damped["period"].u, "units": "s"}
    best = found.law_amplitude.sel(law=damped.motion.damping.selected)
    assert float(abs(best - found.amplitude_of_window)[found.kept].max()) < 2e-4
    assert {"velocity", "u_velocity", "acceleration"} <= set(found)
    for analysis, name in ((damped, "damped.nc"), (still, "still.nc")):
        analysis.to_dataset().to_netcdf(tmp_path / name, engine="h5netcdf")
        with xr.open_dataset(tmp_path / name, engine="h5netcdf", decode_times=False) as again:
            xr.testing.assert_equal(again.load(), analysis.to_dataset())


def test_an_analysis_travels_between_processes(damped: sm.Analysis) -> None:
    """Pickled and back it is the same, its estimates still correlated."""
    again = pickle.loads(pickle.dumps(damped))
    assert again.estimates == damped.estimates
    assert (again["period"] * again["frequency"]).std_dev < 1e-12
    assert repr(again) == repr(damped)
