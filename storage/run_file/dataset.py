"""Return a run's samples as an ``xarray.Dataset``: read from the file on demand, or verified and held in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from acquisition.block import Block
from storage.errors import reading
from storage.run_file import layout
from storage.run_file.handle import Contents
from storage.run_file.header import Header

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["checked_dataset", "lazy_dataset"]


def lazy_dataset(contents: Contents) -> xr.Dataset:
    """Return a dataset that reads from the run's open file; see :meth:`storage.run_file.reading.Run.dataset`.

    Raises
    ------
    RunClosed, RunDamaged
    """
    import h5netcdf
    import xarray as xr

    for name in contents.header.columns:
        contents.column(name)  # checks type and length, unlike lazy reading
    contents.demand_own_signal()
    with reading(contents.path, layout.SIGNAL):
        # Through the run's open handle, because the path may lead to another file by now.
        file = h5netcdf.File(contents.file(), "r")
        store = xr.backends.H5NetCDFStore(file, group=layout.SIGNAL)
        dataset = xr.open_dataset(store, decode_times=False)  # elapsed seconds are not dates
    dataset.attrs = _attributes(contents.header)
    return dataset


def checked_dataset(contents: Contents, samples: Block) -> xr.Dataset:
    """Return a dataset of verified samples; see :meth:`storage.run_file.reading.Run.load_dataset`."""
    import xarray as xr

    header = contents.header
    values = layout.arrays(samples, header.info.sigma_m)
    variables = {}
    for column in layout.COLUMNS:
        if column.path.startswith(layout.SIGNAL) and column.name in header.columns:
            attributes = layout.column_attributes(column, header)
            attributes.pop("_FillValue", None)  # xarray stores it in the encoding
            variables[column.name] = ("time", values[column.name], attributes)
    return xr.Dataset(variables, attrs=_attributes(header))


def _attributes(header: Header) -> dict[str, Any]:
    instrument = {
        path.rpartition("/")[2]: value
        for path, value in layout.fields(header).items()
        if path.startswith(layout.INSTRUMENT)
    }
    return instrument | layout.signal_attributes(header)
