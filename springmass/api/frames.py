"""Analyses and comparisons as pandas frames and xarray datasets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.quantity import Unit
from pipeline.results.budget import Budget
from pipeline.results.compare import Comparison
from pipeline.track import Quality
from springmass.report.motion_table import smoothed_or_why
from springmass.report.tables import table_rows

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["comparison_frame", "estimates_frame", "run_dataset"]


def estimates_frame(analysis: Analysis, *, correlations: bool = False) -> pd.DataFrame:
    """Return one row per estimate; see :meth:`springmass.api.analysis.Analysis.to_dataframe`."""
    import pandas as pd

    motion = analysis.motion
    derived = motion.derived if isinstance(motion, Oscillation) else None
    everything = {**analysis.estimates, **({} if derived is None else derived.coefficients)}
    by_name = {row.name: row for row in table_rows([analysis])}
    rows: list[dict[str, Any]] = []
    for name, x in everything.items():
        row = by_name.get(name)
        words = {"quantity": name.replace("_", " "), "symbol": ""}
        if row is not None:
            words = {"quantity": row.quantity, "symbol": row.symbol}
        budget = None if derived is None else derived.budgets.get(name)
        rows.append({**words, "value": x.value, "u": x.u, "unit": x.unit, **_expanded(budget)})
    frame = pd.DataFrame(rows, index=pd.Index(list(everything), name="name"))
    if correlations and derived is not None:
        names, matrix = derived.joint.names, derived.joint.correlation
        beside = pd.DataFrame(matrix, index=names, columns=[f"r({name})" for name in names])
        frame = frame.join(beside[[f"r({name})" for name in frame.index]])
    return frame


def _expanded(budget: Budget | None) -> dict[str, float]:
    if budget is None:
        return {"dof": math.nan, "coverage_factor": math.nan, "expanded": math.nan}
    return {"dof": budget.dof, "coverage_factor": budget.coverage_factor, "expanded": budget.expanded}


def comparison_frame(found: Comparison, periods: dict[str, Estimate]) -> pd.DataFrame:
    """Return one row per run and one for their mean, indexed by name.

    Parameters
    ----------
    found : Comparison
    periods : dict of str to Estimate
        Period of each run, by name.
    """
    import pandas as pd

    rows = [
        {"period": periods[name].value, "u_period": periods[name].u, "spring_constant": k.value, "u": k.u}
        | {"u_own": own, "pull": pull, "agree": found.agree}
        for name, k, own, pull in zip(found.names, found.each, found.own_u, found.pulls, strict=True)
    ]
    mean = found.spring_constant if found.agree else Estimate(math.nan, math.nan, "N/m")
    none = {"period": math.nan, "u_period": math.nan, "u_own": math.nan, "pull": math.nan}
    rows.append(none | {"spring_constant": mean.value, "u": mean.u, "agree": found.agree})
    columns = ["period", "u_period", "spring_constant", "u", "u_own", "pull", "agree"]
    return pd.DataFrame(rows, index=pd.Index([*found.names, "together"], name="run"), columns=columns)


def run_dataset(analysis: Analysis) -> xr.Dataset:
    """Return samples, windows and estimates; see :meth:`springmass.api.analysis.Analysis.to_dataset`."""
    import xarray as xr

    track, motion = analysis.track, analysis.motion
    of_value, of_first, of_second = (Unit(1, -order).of(track.unit) for order in range(3))
    flags = {
        "flag_masks": np.array([flag.value for flag in Quality], np.uint8),
        "flag_meanings": " ".join(str(flag.name).lower() for flag in Quality),
    }
    variables: dict[str, Any] = {
        "distance": ("time", track.y, {"units": track.unit, "long_name": "distance from the sensor"}),
        "quality": ("time", analysis.flags, flags),
    }
    coordinates: dict[str, Any] = {"time": ("time", track.t, {"units": "s"})}
    if isinstance(motion, Oscillation):
        fit = {"fit": motion.waveform.position, "residual": motion.waveform.residual, "rest": motion.rest.at(track.t)}
        variables |= {name: ("time", values, {"units": of_value}) for name, values in fit.items()}
        smoothed = smoothed_or_why(analysis)
        if not isinstance(smoothed, str):
            for name, unit in (("position", of_value), ("velocity", of_first), ("acceleration", of_second)):
                for each in (name, f"u_{name}"):
                    variables[each] = ("time", getattr(smoothed, each), {"units": unit})
        damping, windows = motion.damping, motion.demodulated
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
    coefficients = motion.derived.coefficients if isinstance(motion, Oscillation) else {}
    for name, x in {**analysis.estimates, **coefficients}.items():
        variables[name] = ((), x.value, {"u": x.u, "units": x.unit or "1"})
    attributes = {"kind": track.kind, "name": getattr(analysis, "name", "")}
    if isinstance(motion, Oscillation):
        attributes["damping_law"] = motion.damping.selected
    return xr.Dataset(variables, coordinates, attributes)
