"""One run file, every reader: xarray with both engines, h5py, netCDF's own library and dump, NeXus."""

from pathlib import Path
from typing import Literal

import h5py
import numpy as np
import pytest

from acquisition.block import Block, Flag, SourceInfo
from acquisition.recordings.recording import FormatIssue, Original
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run
from tests.sampling import sampled

xr = pytest.importorskip("xarray")

ENGINES: tuple[Literal["h5netcdf", "netcdf4"], ...] = ("h5netcdf", "netcdf4")


def write(path: Path, n: int, *, full: bool) -> Path:
    """Write a run of n samples, with everything or with the least."""
    rng = np.random.default_rng(n)
    t = np.arange(n) / 100
    distance = 0.5 + rng.normal(0, 3e-4, n)
    distance[::5] = np.nan
    flags = np.where(np.isnan(distance), Flag.MISSING, 0).astype(np.uint8)
    if not full:
        return write_run(path, [Block(0, t, distance, flags)], SourceInfo("replay", "a.txt", 100.0))
    block = Block(0, t, distance, flags, (t * 1e9).astype(np.int64), rng.normal(size=n))
    return write_run(
        path,
        [block],
        SourceInfo("simulated", "spring.toml", 100.0, sigma_m=3e-4, quantum_m=1e-4),
        originals=[Original("lauf position.txt", b"0\t1\n" * 40), Original("empty.txt", b"")],
        scene={"bob": {"mass_kg": 0.2}},
        title="Träger ①",
        traps=[FormatIssue("truncated_row", "One row was cut.")],
        provenance={"software": "springmass", "version": "0.1.0", "start_time": "2024-05-01T12:00:00Z"},
    )


@pytest.fixture(
    params=sampled(
        [
            pytest.param((300, True), id="full"),
            pytest.param((0, False), id="least empty"),
            pytest.param((300, False), id="least"),
            pytest.param((0, True), id="empty"),
            pytest.param((65_537, True), id="growing"),
        ]
    )
)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a run file in each of the shapes that the layout allows."""
    n, full = request.param
    return write(tmp_path / "run.h5", n, full=full)


@pytest.mark.parametrize("group", [None, "entry/signal"])
@pytest.mark.parametrize("engine", [None, *ENGINES])
def test_xarray_opens_the_signal(path: Path, engine: Literal["h5netcdf", "netcdf4"], group: str | None) -> None:
    """Time, distance, flags and what else the file has, at the root too, whichever engine xarray chooses."""
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    with open_run(path) as run:
        own, info = run.samples(), run.info
    with xr.open_dataset(path, engine=engine, group=group) as result:
        assert result.distance.dims == ("time",)
        for name, values in (("time", own.t), ("distance", own.distance), ("quality", own.flags)):
            assert result[name].dtype == values.dtype
            np.testing.assert_array_equal(result[name], values)
        if own.velocity is not None:
            np.testing.assert_array_equal(result.velocity, own.velocity)
        if info.sigma_m is not None:  # stands beside measured samples only
            expected = np.where(np.isnan(own.distance), np.nan, np.float32(info.sigma_m))
            np.testing.assert_array_equal(result.distance_errors, expected)
        assert result.attrs["kind"] == info.kind
        assert (result.time.attrs["units"], result.distance.attrs["units"]) == ("s", "m")


def test_a_file_without_names_at_the_root_opens(path: Path) -> None:
    """As files from before there were any: it verifies, and its samples are the same."""
    with open_run(path) as run:
        own = run.samples()
    with h5py.File(path, "r+") as file:
        for name in set(file) - {"entry", "raw", "wire"}:
            del file[name]
    with open_run(path) as run:
        run.verify()
        np.testing.assert_array_equal(run.samples().distance, own.distance)


@pytest.mark.parametrize("engine", ENGINES)
def test_xarray_opens_the_whole_tree(path: Path, engine: Literal["h5netcdf", "netcdf4"]) -> None:
    """Every group opens, and the kind stands at the root."""
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    with xr.open_datatree(path, engine=engine) as tree:
        assert {"/entry/signal", "/entry/instrument", "/entry/provenance", "/raw"} <= set(tree.groups)
        assert tree.attrs["kind"] in ("replay", "simulated")
        assert tree["entry/instrument/rate_hz"].item() == 100.0
        tree.load()


def test_h5py_finds_texts_dimensions_and_plain_filters(path: Path) -> None:
    """A reader without conventions sees texts, a time scale on every column, and filters it always has."""
    with h5py.File(path) as file:
        assert file.attrs["Conventions"] == b"CF-1.11"
        signal = file[file.attrs["default"]][file["entry"].attrs["default"]]
        assert signal.attrs["signal"] == b"distance"
        for name, array in signal.items():
            if name != "time":
                assert array.dims[0]["time"] == signal["time"]
            packed = (None, False) if name in ("distance", "velocity") else ("gzip", True)
            assert (array.compression, array.shuffle, array.fletcher32) == (*packed, True)
            assert "scale_factor" not in array.attrs
        quality = signal["quality"].attrs
        meanings = b"missing false_echo clipped duplicate_time non_monotonic_time malformed gap_before"
        assert quality["flag_meanings"] == meanings
        assert quality["flag_masks"].tolist() == [1, 2, 4, 8, 16, 32, 64]


@pytest.mark.parametrize("full", [True, False])
def test_nexus_finds_the_default_plot(tmp_path: Path, full: bool) -> None:
    """A NeXus tool plots distance over time unasked, with error bars where sigma is known."""
    nexus = pytest.importorskip("nexusformat.nexus")
    path = write(tmp_path / "run.h5", 300, full=full)
    root = nexus.nxload(path)
    try:
        plot = root.plottable_data
        assert plot.nxpath == "/entry/signal"
        assert plot.nxsignal.nxname == "distance"
        assert [axis.nxname for axis in plot.nxaxes] == ["time"]
        assert plot.nxsignal.attrs["units"] == "m"
        assert (plot.nxerrors is not None) == full
    finally:
        root.nxfile.close()
