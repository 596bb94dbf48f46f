"""A chart as data: panels of series, each with a role that decides its look."""

from __future__ import annotations

import base64
import itertools
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.track import F8
from pipeline.units import RECORDED_UNITS, Unit
from springmass.typeset import page_unit

Role = Literal["data", "law", "other", "time", "rest", "flagged", "band", "mark"]
"""What a series is; ``looks`` has its colours, dashes and marker."""

MOST_POINTS, MOST_OF_LINE = 12_500, 6_000
"""Largest series that is kept as it is; of a larger one two thirds as many rows remain: the extremes of bins."""

WINDING = 12  # ways from its lowest to its highest value, along all of a line


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Points or a line; ``u`` gives points error bars and a line a band, ``why`` is the text of each point.

    A band is filled from y - u to y + u. A mark without y is a vertical line, a mark with y a ring; both show their
    text.
    """

    label: str
    x: F8
    y: F8
    role: Role = "data"
    line: bool = False
    u: F8 | None = None
    why: tuple[str, ...] | None = None

    @property
    def winds(self) -> bool:
        """Whether a line goes up and down so often that its dashes would only make moiré: it is drawn solid."""
        y = self.y[np.isfinite(self.y)]
        return self.line and y.size > 2 and float(np.abs(np.diff(y)).sum()) > WINDING * float(np.ptp(y))

    def at(self, rows: NDArray[np.intp]) -> Series:
        """Return the series with these rows alone."""
        u, why = None if self.u is None else self.u[rows], self.why and tuple(self.why[row] for row in rows)
        return replace(self, x=self.x[rows], y=self.y[rows], u=u, why=why)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One pair of axes. Panels of a chart with the same ``x_label`` show the same range of x.

    ``log`` is None where a logarithmic axis makes no sense, else whether it is logarithmic at first. The range is that
    of the series except flagged, rest and, beside points, other; what lies beyond is drawn at the edge.
    """

    label: str
    series: tuple[Series, ...]
    height: float = 2.4
    x_label: str = "time / s"
    log: bool | None = None
    log_x: bool = False
    equal: bool = False  # a circle of velocity over angular frequency against displacement is drawn round
    zero: bool = False  # residuals: a range symmetric about a line at zero
    range: tuple[float, float] | None = None
    names: tuple[str, ...] = ()  # of x = 1, 2, ... in place of numbers

    def reach(self) -> tuple[float, float]:
        """Return the range of y: that of all series but those that may lie beyond the axis."""
        if self.range is not None:
            return self.range
        points = any(s.role == "data" and not s.line and s.y.size for s in self.series)
        beyond = ("flagged", "rest", "mark", *(("other",) if points else ()))
        series = [s for s in self.series if s.role not in beyond] or self.series
        us = [0.0 if s.u is None or self.log else np.nan_to_num(s.u) for s in series]
        ends = np.concatenate([s.y + sign * u for s, u in zip(series, us, strict=True) for sign in (-1, 1)])
        ends = ends[np.isfinite(ends) & ((ends > 0.0) | (not self.log))]
        low, high = (float(np.min(ends)), float(np.max(ends))) if ends.size else (0.1, 1.0)
        if self.log:
            return 0.8 * low, 1.25 * high
        most = 1.1 * max(abs(low), abs(high)) or 1.0
        margin = 0.07 * (high - low) or 0.01 * abs(high) or 1.0
        return (-most, most) if self.zero else (low - margin, high + margin)


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Panels above one another; ``detail`` is the end of the first periods, drawn by themselves in a file."""

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    detail: float | None = None


def thinned(series: Series, of_line: int = MOST_OF_LINE) -> Series:
    """Keep each bin's least and greatest value of a series that is too long; of points, also every n-th."""
    largest = of_line if series.line else MOST_POINTS
    if series.x.size <= largest:
        return series
    most = 2 * largest // 3
    y = np.where(np.isfinite(series.y), series.y, np.nanmedian(series.y) if np.isfinite(series.y).any() else 0.0)
    bins = most // (2 if series.line else 4)
    edges = np.linspace(0, y.size, bins + 1).astype(np.intp)
    ends = [at + f(y[at:to]) for at, to in itertools.pairwise(edges) for f in (np.argmin, np.argmax)]
    return series.at(np.unique(ends if series.line else [*ends, *range(0, y.size, -(-y.size // (most // 2)))]))


def to_json(chart: Chart) -> dict[str, Any]:
    """Return a chart for charts.js; ``xs`` holds each x once, and a series names its x by number.

    Numbers are 32-bit floats in base64, two thirds of the bytes of their digits; no screen shows their error.
    x is start, step and count if it is evenly spaced, else a start with the differences from it. NaN is missing.
    """
    xs: list[dict[str, Any]] = []
    panels = []
    for panel in chart.panels:
        series = []
        for thin in map(thinned, panel.series):
            x = _evenly(thin.x) or _from_start(thin.x)
            if x not in xs:
                xs.append(x)
            entry: dict[str, Any] = {"label": thin.label, "role": thin.role, "line": thin.line}
            entry |= {"x": xs.index(x), "y": coded(thin.y), **({"winds": True} if thin.winds else {})}
            if thin.u is not None:
                entry["u"] = coded(thin.u)
            if thin.why is not None:
                words = list(dict.fromkeys(thin.why))
                entry |= {"why": [words.index(each) for each in thin.why], "words": words}
            series.append(entry)
        axes = {"label": panel.label, "x_label": panel.x_label, "height": panel.height, "log": panel.log}
        shown = {name: getattr(panel, name) for name in ("log_x", "equal", "zero", "names") if getattr(panel, name)}
        panels.append(axes | shown | {"range": panel.reach(), "series": series})
    return {"name": chart.name, "title": chart.title, "xs": xs, "panels": panels}


def _evenly(x: F8) -> dict[str, float] | None:
    """Return evenly spaced numbers as start, step and count."""
    if x.size > 2 and np.isfinite(x).all():
        step = float(x[-1] - x[0]) / (x.size - 1)
        if step > 0.0 and np.max(np.abs(x - x[0] - step * np.arange(x.size))) < 0.01 * step:
            return {"start": float(x[0]), "step": step, "count": int(x.size)}
    return None


def _from_start(x: F8) -> dict[str, Any]:
    start = float(x[np.isfinite(x)][0]) if np.isfinite(x).any() else 0.0
    return {"start": start, "after": coded(x - start)}


def coded(values: F8) -> str:
    """Return numbers in base64."""
    return base64.b64encode(values.astype("<f4").tobytes()).decode()


def decoded(text: str) -> F8:
    """Return the numbers of a chart's JSON."""
    return np.frombuffer(base64.b64decode(text), "<f4").astype(np.float64)


def value_label(what: str, unit: str) -> str:
    """Return the label of an axis with the unit in which values of a recording are shown.

    >>> value_label("amplitude", "m"), value_label("amplitude", "m/s^2")
    ('amplitude / mm', 'amplitude / (m/s²)')
    """
    return quantity_over(what, RECORDED_UNITS[unit].unit)


def rate_label(what: str, order: int, unit: str) -> str:
    """Return the label of an axis of a derivative by time.

    >>> rate_label("velocity", 1, "m"), rate_label("rate", 1, "rad")
    ('velocity / (m/s)', 'rate / (rad/s)')
    """
    return quantity_over(what, Unit(1, -order).of(unit))


def quantity_over(what: str, unit: str) -> str:
    """Return the label of an axis: a quantity over its unit."""
    shown = page_unit(unit)
    return f"{what} / ({shown})" if "/" in shown else f"{what} / {shown}" if shown else what


def line_of(label: str, x: F8, y: F8, role: Role = "law") -> Series:
    """Return a line."""
    return Series(label, x, y, role, line=True)


def band_of(label: str, x: F8, y: F8, u: F8) -> Series:
    """Return a band from y - u to y + u."""
    return Series(label, x, y, "band", line=True, u=u)


@dataclass(frozen=True, slots=True)
class ChartNote:
    """A mark or an event of a recording."""

    t_s: float
    text: str
    kind: str
