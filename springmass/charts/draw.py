"""Any chart drawn with matplotlib: figures as files, and panels in a notebook's axes."""

from __future__ import annotations

import gc
import io
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from springmass.charts.chart import Chart, Panel, Series, thinned
from springmass.charts.looks import LOOKS
from storage.atomic import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

PictureFormat = Literal["svg", "pdf", "png"]
STYLE = Path(__file__).with_name("figures.mplstyle")
FIGURE_WIDTH_IN = 7.2  # inches, the width of the text on A4
MOST_OF_DRAWN_LINE = 3000  # points
RASTER_POINTS = 300  # of a line; more markers than this are pixels, which are fewer bytes
LONG_LABEL = 30  # characters; three columns of such labels fill the width of a page


NamedChart = tuple[str, Chart]
Counting = Callable[[Collection[NamedChart]], Iterable[NamedChart]]
"""Yields what it is given, and shows how many were taken."""


def save(
    charts: Mapping[str, Chart], folder: Path, kinds: Sequence[PictureFormat], counting: Counting = iter
) -> dict[str, bytes]:
    """Write charts as files of every kind, complete or not at all; return the SVG. Their names are without a suffix."""
    pictures = {}
    for name, chart in counting(charts.items()):
        for kind, data in render(chart, kinds).items():
            write_whole(folder / f"{name}.{kind}", data)
            if kind == "svg":
                pictures[name] = data
    return pictures


def render(chart: Chart, kinds: Sequence[PictureFormat]) -> dict[PictureFormat, bytes]:
    """Return a chart as the bytes of a file of every kind."""
    with style(), _uncollected():
        from matplotlib.layout_engine import ConstrainedLayoutEngine

        figure = figure_of(chart)
        # A figure that has the engine would find the same places for every file again, and draw twice for it.
        ConstrainedLayoutEngine().execute(figure)
        return {kind: written(figure, kind) for kind in kinds}


@contextmanager
def _uncollected() -> Iterator[None]:
    """Let no garbage be collected: a PDF's font is many objects, with which it takes a third of the time."""
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()


def style() -> AbstractContextManager[None]:
    """Return a context that draws and saves in the report's style, whatever the user's settings and MPLBACKEND say."""
    backend = os.environ.pop("MPLBACKEND", None)  # a file needs none, and with a wrong one matplotlib is not imported
    try:
        from matplotlib import rc_context
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    return rc_context(fname=STYLE)


def written(figure: Figure, kind: PictureFormat) -> bytes:
    """Return a figure as the bytes of a file, without a date, so that equal runs give identical files."""
    out = io.BytesIO()
    dated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[kind]
    figure.savefig(out, format=kind, dpi=300 if kind == "png" else 150, metadata=dated)
    return _shorter(out.getvalue()) if kind == "svg" else out.getvalue()


def _shorter(svg: bytes) -> bytes:
    """Round coordinates to a hundredth of a point; matplotlib's six digits are most of a figure's bytes."""
    return re.sub(rb'\s(?:d|x|y)="[^"]*"', lambda found: re.sub(rb"(\.\d\d)\d+", rb"\1", found[0]), svg)


def figure_of(chart: Chart) -> Figure:
    """Draw a chart; if it has a detail, the panels against the same x are drawn once more, up to its end."""
    from matplotlib.figure import Figure

    parts: list[tuple[Panel, float | None]] = [(panel, None) for panel in chart.panels]
    if chart.detail is not None:
        again = [panel for panel in chart.panels if panel.x_label == chart.panels[0].x_label]
        parts += [(panel, chart.detail) for panel in again]
    heights = [panel.height * 1.15 if panel.equal else max(1.3, 0.8 * panel.height) for panel, _ in parts]
    width = 5.6 if any(panel.equal for panel in chart.panels) else FIGURE_WIDTH_IN
    figure = Figure(figsize=(width, sum(heights) + 0.3), layout=None)
    axes = list(figure.subplots(len(parts), 1, squeeze=False, height_ratios=heights).ravel())
    figure.align_ylabels(axes)
    spans = {panel.x_label: _span(chart, panel.x_label) for panel in chart.panels}
    named: set[str] = set()
    for i, ((panel, end), ax) in enumerate(zip(parts, axes, strict=True)):
        draw(_until(panel, end), ax)
        after, its_end = parts[i + 1] if i + 1 < len(parts) else (None, None)
        if after is not None and after.x_label == panel.x_label and its_end == end and not panel.equal:
            ax.set_xlabel("")
            ax.tick_params(labelbottom=False)
        low, high = spans[panel.x_label]
        if not panel.equal and not panel.names and low < high:
            ax.set_xlim(low, high if end is None else end)
        labels = {label for label in ax.get_legend_handles_labels()[1] if label not in named}
        if len(ax.get_legend_handles_labels()[1]) > 1 and labels:
            legend(ax)
            named |= labels
        if end is not None and panel is chart.panels[0]:
            ax.set_title("the first periods", fontsize=8.5, loc="right")
    return figure


def _span(chart: Chart, x_label: str) -> tuple[float, float]:
    """Return the range of x of all panels with this label."""
    x = np.concatenate([s.x[np.isfinite(s.x)] for p in chart.panels if p.x_label == x_label for s in p.series])
    return (float(np.min(x)), float(np.max(x))) if x.size else (0.0, 0.0)


def _until(panel: Panel, end: float | None) -> Panel:
    """Return a panel with the part of its series up to an end."""
    if end is None:
        return panel
    parts = (part.at(np.flatnonzero(part.x <= end)) for part in panel.series)
    return replace(panel, series=tuple(part for part in parts if part.x.size))


def legend(ax: Axes) -> None:
    """Put a legend above a panel, left edges aligned."""
    labels = ax.get_legend_handles_labels()[1]
    columns = 2 if any(len(label) > LONG_LABEL for label in labels) else 3
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)


def draw(panel: Panel, ax: Axes) -> Axes:
    """Draw a panel into axes, in their own style; text from outside is never set as mathematics."""
    low, high = panel.reach()
    labels: dict[str, list[str]] = {}
    named: set[str] = set()
    for i, series in enumerate(each if panel.equal else thinned(each, MOST_OF_DRAWN_LINE) for each in panel.series):
        label = "_" if series.label in named else series.label.replace("$", r"\$")
        named.add(series.label)
        of_role = labels.setdefault(series.role, [])
        if series.label not in of_role:
            of_role.append(series.label)
        _draw(ax, series, label, of_role.index(series.label), (low, high), 1.5 + 0.01 * i)
    if panel.log:
        low = low if low > 0.0 else high * 1e-6
        ax.set_yscale("log")
        _logarithmic(ax.yaxis, high / low)
    if panel.log_x:
        ax.set_xscale("log")
        _logarithmic(ax.xaxis, ax.get_xlim()[1] / max(ax.get_xlim()[0], 1e-9))
    if panel.zero:
        ax.axhline(0.0, color="#000000", lw=0.8, zorder=1.4)
    ax.set_ylim(low, high)
    if panel.names:
        ax.set_xticks(range(1, len(panel.names) + 1), [name.replace("$", r"\$") for name in panel.names])
        ax.tick_params(axis="x", labelrotation=20 if sum(map(len, panel.names)) > 60 else 0)
    if panel.equal:
        ax.set_box_aspect(1.0)
        ax.margins(x=0.05)
        ax.locator_params(axis="x", nbins=5)  # long numbers would meet in a square
    ax.set(xlabel=panel.x_label, ylabel=panel.label)
    return ax


def _logarithmic(axis: Axis, ratio: float) -> None:
    """Write plain numbers at powers of ten of a logarithmic axis, and at more places if it spans less than two."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(
        LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0) if ratio < 6.0 else (1.0, 2.0, 5.0) if ratio < 100.0 else (1.0,))
    )
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _draw(ax: Axes, s: Series, label: str, number: int, ends: tuple[float, float], above: float) -> None:
    of_role = LOOKS[s.role]
    colour, dash = (of_role[name][number % len(of_role[name])] for name in ("light", "dash"))
    style: dict[str, Any] = {"color": colour, "label": label, "zorder": above}
    flat = s.x.size > RASTER_POINTS
    if s.role == "mark":
        for x, y, text in zip(s.x.tolist(), s.y.tolist(), s.why or [""] * s.x.size, strict=True):
            if np.isfinite(y):
                ax.plot([x], [y], "o", mfc="none", ms=4, **style)
            else:
                ax.axvline(x, lw=0.9, ls=(0, (4, 2)), **style)
            at, where = ((x, y), ax.transData) if np.isfinite(y) else ((x, 0.98), ax.get_xaxis_transform())
            look: dict[str, Any] = {"fontsize": 7, "color": colour, "clip_on": True, "ha": "center", "va": "bottom"}
            turned = {} if np.isfinite(y) else {"rotation": 90, "ha": "right", "va": "top"}
            ax.text(at[0], at[1], text[:24].replace("$", r"\$"), transform=where, **look | turned)
            style["label"] = "_"
    elif s.line:
        if s.u is not None:
            name = label if s.role == "band" else "_"
            opacities = of_role.get("opacity", (0.25,))
            shade: dict[str, Any] = {"alpha": opacities[number % len(opacities)], "lw": 0, "zorder": above}
            ax.fill_between(s.x, s.y - s.u, s.y + s.u, color=colour, label=name, **shade)
        if s.role != "band":
            lines = [] if s.winds else [part / 2 for part in dash]
            style |= {"alpha": 0.7} if s.winds else {}
            ax.plot(s.x, s.y, lw=1.2 if s.role != "rest" else 0.8, ls=(0, lines) if lines else "-", **style)
    else:
        marker = {"dot": "o", "ring": "o", "cross": "x"}[of_role["marker"]]
        look = {"fmt": marker, "ms": 2.4 if flat else 3.4, "mew": 0 if of_role["marker"] == "dot" else 0.8}
        shown = np.clip(s.y, *ends) if s.role == "flagged" else s.y
        hollow: dict[str, Any] = {"mfc": "none"} if of_role["marker"] == "ring" else {}
        ax.errorbar(s.x, shown, s.u, elinewidth=0.8, rasterized=flat, **style, **look, **hollow)
