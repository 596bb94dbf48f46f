"""Arrays in memory: units are read or refused, never ignored."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import springmass as sm
from pipeline.errors import TrackError

T = np.arange(3000) / 100
Y = 0.2 + 0.05 * np.cos(8.0 * T) + 1e-4 * np.random.default_rng(1).standard_normal(T.size)
ARRAYS: dict[str, tuple[Any, dict[str, str]]] = {
    "metres": ((T, Y), {}),
    "centimetres": ((T, 100.0 * Y), {"unit": "cm"}),
    "milliseconds": ((1000.0 * T, Y), {"time_unit": "ms"}),
    "coordinate in ms": (xr.DataArray(Y, coords={"time": ("time", 1000.0 * T, {"units": "ms"})}, dims="time"), {}),
    "the only coordinate": (xr.DataArray(Y, coords={"t": ("t", 1000.0 * T, {"units": "ms"})}, dims="t"), {}),
    "data in mm": (xr.DataArray(1000.0 * Y, coords={"time": T}, dims="time", attrs={"units": "mm"}), {}),
    "headings of a CSV": (pd.DataFrame({"Time (s)": T, "Distance (cm)": 100.0 * Y}), {}),
    "index of times": (pd.Series(Y, index=T), {}),
    "dates with a zone": (pd.Series(Y, index=pd.to_datetime(1e9 * T).tz_localize("Europe/Berlin")), {}),
    "column of dates": (pd.DataFrame({"time": pd.to_datetime(1e9 * T).tz_localize("UTC"), "distance": Y}), {}),
    "quantities of pint": (
        (
            SimpleNamespace(magnitude=1e3 * T, units="millisecond"),
            SimpleNamespace(magnitude=1e2 * Y, units="centimeter"),
        ),
        {},
    ),
    "masked values": ((T, np.ma.masked_array(Y, np.arange(T.size) == 1500)), {}),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_a_unit_is_read(name: str) -> None:
    """The same motion in any container and unit."""
    source, how = ARRAYS[name]
    found = sm.analyse(source, **how)
    assert found["T"].value == pytest.approx(2.0 * np.pi / 8.0, rel=1e-5)
    assert found["A0"].value == pytest.approx(0.05, rel=1e-3)
    assert found["A0"].unit == "m"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sm.analyse(pd.Series(Y)), "counts rows"),
        (lambda: sm.analyse(pd.DataFrame({"distance": Y})), "counts rows"),
        (lambda: sm.analyse((T, Y), unit="parsec"), "unknown unit 'parsec' of the values"),
        (lambda: sm.analyse((T, Y), time_unit="fortnight"), "unknown unit 'fortnight' of the times"),
        (lambda: sm.analyse((T, Y + 0j)), "complex"),
        (lambda: sm.analyse((T, ["far"] * T.size)), "no numbers"),
        (lambda: sm.analyse(pd.DataFrame({"Time (s)": T, "a (cm)": Y, "b (cm)": Y})), "'a \\(cm\\)', 'b \\(cm\\)'"),
    ],
)
def test_what_has_no_meaning_is_refused(call: Callable[[], Any], said: str) -> None:
    """One sentence that says what to do."""
    with pytest.raises(TrackError, match=said):
        call()
