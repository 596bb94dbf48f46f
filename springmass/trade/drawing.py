"""Plots of error against time for methods on simulated records and for integrators on scenes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from springmass.charts.draw import style
from springmass.trade.integrators import Work
from springmass.trade.measure import EQUAL, Row, Trade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["front", "integrators_figure", "trade_figure"]

LABELS = {"frequency": "frequency", "amplitude": "amplitude", "damping_rate": "damping"}
MARKERS = "oDsx^vP*+"
SMALLEST = 1e-15
"""Smaller errors are drawn at this value: double precision cannot resolve them, and a logarithmic axis has no zero."""


def trade_figure(trade: Trade) -> Figure:
    """Draw one panel per quantity with the error over the bound against time, the Pareto front and the bound."""
    with style():
        figure, axes = _panels(len(trade.bound), "time for one record / ms")
        for axis, quantity in zip(axes, trade.bound, strict=True):
            for i, row in enumerate(trade.rows):
                if quantity in row.error:
                    time_ms, error = row.seconds * 1e3, row.error[quantity]
                    axis.plot(time_ms, error, MARKERS[i], color=f"C{i}", mfc="none", label=row.method.label)
            edge = front(trade.rows, quantity)
            times_ms, errors = [row.seconds * 1e3 for row in edge], [row.error[quantity] for row in edge]
            axis.step(times_ms, errors, where="post", color="grey", label="Pareto front")
            axis.axhline(1.0, color="grey", ls="--", label="bound")
            axis.set_ylabel(f"{LABELS[quantity]} error / bound")
        _legend(figure, axes)
        return figure


def front(rows: Sequence[Row], quantity: str) -> list[Row]:
    """Return the methods on the Pareto front of time and error, quickest first; errors within 1 % count as equal."""
    edge: list[Row] = []
    for row in sorted((row for row in rows if quantity in row.error), key=lambda row: row.seconds):
        if not edge or row.error[quantity] * (1.0 + EQUAL) < edge[-1].error[quantity]:
            edge.append(row)
    return edge


def integrators_figure(rows: Sequence[Work], label: str = "time for 120 s at 100 Hz / ms") -> Figure:
    """Draw one panel per scene: error against time of every integrator, with a ring around each choice of auto."""
    scenes, names = (list(dict.fromkeys(getattr(row, key) for row in rows)) for key in ("scene", "method"))
    with style():
        figure, axes = _panels(len(scenes), label)
        for axis, scene in zip(axes, scenes, strict=True):
            axis.set_title(scene, loc="right", fontsize="medium")
            axis.set_ylabel("error / amplitude")
            for i, name in enumerate(names):
                own = [row for row in rows if (row.scene, row.method, row.tolerance) == (scene, name, None)]
                axis.plot(*_curve(own), marker=MARKERS[i], color=f"C{i}", label=name)
            auto = [row for row in rows if row.scene == scene and row.tolerance is not None]
            axis.plot(*_curve(auto), "ko", ms=10, mfc="none", label="taken by auto")
        _legend(figure, axes)
        return figure


def _curve(rows: Sequence[Work]) -> tuple[list[float], list[float]]:
    ordered = sorted(rows, key=lambda row: row.seconds)
    return [row.seconds * 1e3 for row in ordered], [max(row.error, SMALLEST) for row in ordered]


def _panels(count: int, label: str) -> tuple[Figure, list[Axes]]:
    """Make panels, one above the other, with logarithmic axes and a shared time axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 0.9 + 2.3 * count), layout="constrained")
    axes = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axis in axes:
        axis.set(xscale="log", yscale="log")
    axes[-1].set_xlabel(label)
    return figure, axes


def _legend(figure: Figure, axes: Sequence[Axes]) -> None:
    """Put one legend of all panels above them."""
    handles: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=4, markerscale=1.0)
