"""The results of a course, for pandas and xarray."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal

from springmass.batch.rows import NUMBERS, UNITS, WHOLE, columns_of, read_rows

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["results"]


def results(
    folder: str | os.PathLike[str], *, form: Literal["frame", "dataset"] = "frame"
) -> pd.DataFrame | xr.Dataset:
    """Return the table that ``springmass batch`` made, with one row per run.

    Parameters
    ----------
    folder : path
        The folder of results.
    form : {"frame", "dataset"}
        A :class:`pandas.DataFrame`, or an :class:`xarray.Dataset` with the dimension ``run`` and attributes ``units``.

    Returns
    -------
    pandas.DataFrame or xarray.Dataset
        Columns as in the reference of a course's results: NAME and NAME_u in SI units, NaN where a run has no value.

    Raises
    ------
    springmass.errors.ProgramError
        If the folder contains no course, or its table is damaged.
    """
    import pandas as pd

    rows, tags = read_rows(folder)
    frame = pd.DataFrame(rows, columns=columns_of(tags))
    for name in frame.columns:
        if name in NUMBERS:
            frame[name] = frame[name].astype("float64")
        elif name in WHOLE:
            frame[name] = frame[name].astype("Int64")
    if form == "frame":
        return frame
    for name in WHOLE:  # xarray has no integers that may be missing
        frame[name] = frame[name].astype("float64")
    texts = [name for name in frame.columns if name not in NUMBERS and name not in WHOLE]
    frame[texts] = frame[texts].astype(object).where(frame[texts].notna(), "")
    data: Any = frame.set_index("run").to_xarray()
    for name, unit in UNITS.items():
        data[name].attrs["units"] = unit
        if f"{name}_u" in data:
            data[f"{name}_u"].attrs["units"] = unit
    return data
