"""Pandas frames and xarray datasets of a run and of a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.block import Flag
from pipeline.analyse import Analysis
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.several.compare import Comparison
from pipeline.track import Quality
from pipeline.units import Unit
from springmass.loading.arrays import ABOUT, about_json
from springmass.loading.loaded import Loaded
from springmass.result.run_json import EXPANDED, picked
from springmass.result.table1 import numbers_of, table_rows

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def estimates_frame(analysis: Analysis, *, correlations: bool = False) -> pd.DataFrame:
    """Return one row per estimate; see :meth:`springmass.Run.to_dataframe`."""
    import pandas as pd

    values = numbers_of(analysis)
    by_name = {row.name: row for row in table_rows([analysis])}
    rows: list[dict[str, Any]] = []
    for name, x in values.items():
        row = by_name.get(name)
        words = {"quantity": row.quantity, "symbol": row.symbol} if row else {"quantity": name.replace("_", " ")}
        budget = analysis.budgets.get(name)
        expanded = {} if budget is None else picked(budget, EXPANDED)
        rows.append({"symbol": "", **words, "value": x.value, "u": x.u, "unit": x.unit, **expanded})
    columns = ["quantity", "symbol", "value", "u", "unit", *EXPANDED]
    frame = pd.DataFrame(rows, index=pd.Index(list(values), name="name"), columns=columns)
    if correlations:
        names, matrix = analysis.derived.joint.names, analysis.derived.joint.correlation
        beside = pd.DataFrame(matrix, index=names, columns=[f"r({name})" for name in names])
        frame = frame.join(beside[[f"r({name})" for name in frame.index]])
    return frame


def comparison_frame(compared: Comparison, periods: Mapping[str, Estimate]) -> pd.DataFrame:
    """Return one row per run, by name, and one for their mean."""
    import pandas as pd

    rows = [
        {"period": periods[name].value, "u_period": periods[name].u, "spring_constant": k.value, "u": k.u}
        | {"u_own": own_u, "pull": pull, "agree": compared.agree}
        for name, k, own_u, pull in zip(compared.names, compared.each, compared.own_u, compared.pulls, strict=True)
    ]
    mean = compared.spring_constant if compared.agree else Estimate(math.nan, math.nan, "N/m")
    rows.append({"spring_constant": mean.value, "u": mean.u, "agree": compared.agree})  # the others are NaN
    columns = ["period", "u_period", "spring_constant", "u", "u_own", "pull", "agree"]
    return pd.DataFrame(rows, index=pd.Index([*compared.names, "together"], name="run"), columns=columns)


def samples_dataset(loaded: Loaded, scene: Scene) -> xr.Dataset:
    """Return samples as recorded, with everything about them; see :meth:`springmass.Run.dataset`."""
    import xarray as xr

    samples, info = loaded.samples, loaded.info
    flags = {
        "flag_masks": np.array([flag.value for flag in Flag], np.uint8),
        "flag_meanings": " ".join(str(flag.name).lower() for flag in Flag),
    }
    of_value = {"units": samples.unit, "quantity": samples.quantity, "long_name": loaded.channel or samples.quantity}
    variables: dict[str, Any] = {
        "distance": ("time", samples.distance, of_value),
        "quality": ("time", samples.flags, {"standard_name": "quality_flag", **flags}),
    }
    if samples.velocity is not None:
        variables["velocity"] = ("time", samples.velocity, {"units": Unit(1, -1).of(samples.unit)})
    time = {"units": "s", "standard_name": "time", "long_name": "time since the start of the run", "clock": info.clock}
    attributes = {"kind": info.kind, "title": loaded.title, ABOUT: about_json(loaded, scene.to_mapping())}
    return xr.Dataset(variables, {"time": ("time", samples.t, time)}, attributes)


def run_dataset(loaded: Loaded, analysis: Analysis, name: str) -> xr.Dataset:
    """Return samples, windows and estimates; see :meth:`springmass.Run.to_dataset`."""
    dataset, track, motion = samples_dataset(loaded, analysis.scene), analysis.track, analysis.oscillation
    of_value, of_first, of_second = (Unit(1, -order).of(track.unit) for order in range(3))
    meanings = " ".join(str(flag.name).lower() for flag in Quality)
    masks = np.array([flag.value for flag in Quality], np.uint8)
    if len(track) < len(loaded.samples):
        times = loaded.samples.t
        dataset = dataset.isel(time=(times >= np.nanmin(track.t)) & (times <= np.nanmax(track.t)))
    left_out = {"flag_masks": masks, "flag_meanings": meanings, "long_name": "why the analysis left a sample out"}
    variables: dict[str, Any] = {"left_out": ("time", analysis.flags, left_out)}
    coordinates: dict[str, Any] = {}
    if motion is not None:
        fit = {"fit": motion.waveform.position, "residual": motion.waveform.residual, "rest": motion.rest.at(track.t)}
        variables |= {name: ("time", values, {"units": of_value}) for name, values in fit.items()}
        if (smoothed := analysis.smoothed) is not None:
            for name, unit in (("position", of_value), ("velocity", of_first), ("acceleration", of_second)):
                variables[f"smoothed_{name}"] = ("time", getattr(smoothed, name), {"units": unit})
                variables[f"u_smoothed_{name}"] = ("time", getattr(smoothed, f"u_{name}"), {"units": unit})
        damping, windows = motion.damping, motion.windows
        coordinates["window"] = ("window", windows.t, {"units": "s", "long_name": "centre of a window"})
        coordinates["law"] = ("law", list(damping.fits))
        curves = [fit.amplitude(windows.t - damping.t0) for fit in damping.fits.values()]
        variables |= {
            "amplitude_of_window": ("window", windows.amplitude, {"units": of_value}),
            "u_amplitude_of_window": ("window", damping.scatter.u, {"units": of_value}),
            "kept": ("window", damping.scatter.kept, {"long_name": "whether the laws are fitted to it"}),
            "phase_of_window": ("window", windows.phase, {"units": "rad"}),
            "law_amplitude": (("law", "window"), np.array(curves), {"units": of_value}),
        }
        dataset.attrs["damping_law"] = damping.selected
    for quantity, value in numbers_of(analysis).items():
        variables[quantity] = ((), value.value, {"u": value.u, "units": value.unit or "1"})
    return dataset.assign_coords(coordinates).assign(variables).assign_attrs(name=name)
