"""Common parts of all figures: style, panels, legends, and the bytes of a file.

Colours are those of Okabe and Ito. Line style or marker differ as well, so that no figure depends on colour alone.
"""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, Unit
from pipeline.track import F8
from springmass.report.tables import page_unit
from storage.atomic import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BLUE",
    "DENSE_POINTS",
    "GREEN",
    "GREY",
    "KINDS",
    "ORANGE",
    "PURPLE",
    "RASTER_POINTS",
    "SKY",
    "VERMILLION",
    "WIDTH",
    "derivative_label",
    "error_bars",
    "escaped",
    "finish_residual",
    "legend_above",
    "model_phase",
    "moving",
    "panels",
    "render",
    "save",
    "share",
    "style",
    "thinned",
    "value_label",
]

BLUE, SKY, ORANGE, GREEN = "#0072B2", "#56B4E9", "#E69F00", "#009E73"
VERMILLION, PURPLE, GREY = "#D55E00", "#CC79A7", "#7f7f7f"
STYLE = Path(__file__).with_name("report.mplstyle")
WIDTH = 7.2
"""Width of a figure, which is the text width on A4, in inches like all lengths in this module."""
DENSE_POINTS = 2500
"""Maximum number of samples drawn as points; more become a line through the minimum and maximum of each bin."""
RASTER_POINTS = 300
"""Maximum number of markers drawn as shapes; more are rasterized, which takes fewer bytes."""
LONG_LABEL = 30
"""Length of a legend label in characters; three columns of such labels fill the width of a page."""
KINDS: tuple[Literal["svg"], Literal["pdf"]] = ("svg", "pdf")


def style() -> AbstractContextManager[None]:
    """Return a context that draws and saves in the report's style, regardless of the user's settings."""
    from matplotlib import rc_context

    return rc_context(fname=STYLE)


def render(figure: Figure, kind: Literal["svg", "pdf"]) -> bytes:
    """Return a figure as the bytes of a file.

    Parameters
    ----------
    figure : Figure
    kind : {"svg", "pdf"}
    """
    out = io.BytesIO()
    with style():
        _lay_out(figure)
        # Without a date, equal runs give identical files, so that a course does not depend on which process drew its
        # reports.
        figure.savefig(out, format=kind, metadata={"Date" if kind == "svg" else "CreationDate": None})
    return (
        _COORDINATES.sub(lambda found: _DIGITS.sub(rb"\1", found[0]), out.getvalue())
        if kind == "svg"
        else out.getvalue()
    )


def _lay_out(figure: Figure) -> None:
    """Lay out a figure once; otherwise saving draws it a second time for the layout, which doubles the time."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    engine = figure.get_layout_engine()
    if engine is None:
        return
    FigureCanvasAgg(figure)  # measures text much faster than the canvas of a vector file
    engine.execute(figure)
    with rc_context({"figure.constrained_layout.use": False, "figure.autolayout": False}):
        figure.set_layout_engine(None)  # with these settings, None removes the layout engine


# A hundredth of a point is finer than any printer resolves; matplotlib's six digits are most of a figure's bytes.
_COORDINATES = re.compile(rb'\s(?:d|x|y)="[^"]*"')
_DIGITS = re.compile(rb"(\.\d\d)\d+")


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as SVG and as PDF, each file completely or not at all."""
    for kind in KINDS:
        write_whole(folder / f"{name}.{kind}", render(figure, kind))


def panels(heights: Sequence[float], *, width: float = WIDTH, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Make rows of panels in a figure that belongs to no window; return the panels row by row.

    Parameters
    ----------
    heights : sequence of float
        Height of each row in inches, including its labels and legends.
    width : float
        Width of the figure, inches.
    columns : int
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, sum(heights)))
    axes = figure.subplots(len(heights), columns, squeeze=False, height_ratios=list(heights))
    figure.align_ylabels(axes)
    return figure, list(axes.ravel())


def legend_above(panel: Axes, columns: int | None = None, **options: Any) -> None:
    """Put a panel's legend above it, left edges aligned.

    Parameters
    ----------
    panel : Axes
        The panel; it must be as wide as the figure if ``columns`` is omitted.
    columns : int, optional
        Number of columns; default: three, or two if a label is long.
    **options
        Keyword arguments of :meth:`matplotlib.axes.Axes.legend`.
    """
    if columns is None:
        columns = 2 if any(len(label) > LONG_LABEL for label in panel.get_legend_handles_labels()[1]) else 3
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, **options)


def moving(analysis: Analysis) -> Oscillation:
    """Return the oscillation of an analysis; raise ValueError if there is none."""
    if not isinstance(analysis.motion, Oscillation):
        raise ValueError(f"only the position of this record can be drawn, nothing oscillates: {analysis.motion.why}")
    return analysis.motion


def finish_residual(panel: Axes, residual: F8, label: str) -> None:
    """Give a panel of residuals its zero line and a range that is symmetric about it."""
    reach = max(3.5, 1.1 * float(np.max(np.abs(residual), initial=0.0)))
    panel.set_ylim(-reach, reach)
    panel.axhline(0.0, color="#000000", lw=0.8)
    panel.set_ylabel(label)


def share(above: Axes, below: Axes, start: float, end: float) -> None:
    """Let two panels share their time axis, with numbers only below the lower panel."""
    below.sharex(above)
    above.tick_params(labelbottom=False)
    above.set_xlim(start, end)


def error_bars(
    panel: Axes, x: F8, y: F8, u: F8, label: str | None, *, size: float = 3.4, width: float = 0.9, color: str = SKY
) -> None:
    """Draw points with their standard uncertainties."""
    look: dict[str, Any] = {"ms": size, "mew": 0, "color": color, "ecolor": BLUE, "elinewidth": width}
    panel.errorbar(x, y, u, fmt="o", label=label, rasterized=x.size > RASTER_POINTS, **look)


def escaped(text: str) -> str:
    """Return a text of foreign origin with visible control characters, escaped so that matplotlib sets it literally."""
    return visible(text).replace("$", r"\$")  # matplotlib sets text between two dollar signs as mathematics


def value_label(what: str, unit: str) -> str:
    """Return the label of an axis with the unit in which values of a record are shown.

    Examples
    --------
    >>> value_label("amplitude", "m"), value_label("amplitude", "m/s^2")
    ('amplitude / mm', 'amplitude / (m/s²)')
    """
    own = SHOWN[unit].unit
    return f"{what} / {_in_brackets(own)}" if own else what


def derivative_label(what: tuple[str, str], order: int, unit: str) -> str:
    """Return the label of an axis of a derivative by time; ``what`` is its name for a length and for anything else.

    Examples
    --------
    >>> derivative_label(("velocity", "rate"), 1, "m"), derivative_label(("velocity", "rate"), 1, "rad")
    ('velocity / (m/s)', 'rate / (rad/s)')
    """
    return f"{what[unit != 'm']} / {_in_brackets(Unit(1, -order).of(unit))}"


def _in_brackets(unit: str) -> str:
    shown = page_unit(unit)
    return f"({shown})" if "/" in shown else shown


def model_phase(motion: Oscillation, t: F8) -> tuple[F8, F8]:
    """Return fitted displacement and velocity at times t, in the record's unit and in that unit per second."""
    law, angle = motion.damping.best, motion.phase.total(t)
    amplitude = law.amplitude(t - motion.phase.t0)
    cosine, sine = np.cos(angle), np.sin(angle)
    velocity = law.law.rate(amplitude, law.joint.values) * cosine - amplitude * motion.phase.rate(amplitude) * sine
    return amplitude * cosine, velocity


def thinned(y: F8, bins: int) -> NDArray[np.int64]:
    """Return the rows of each bin's minimum and maximum; at one pixel per bin, a plot of them loses nothing."""
    if y.size <= 2 * bins:
        return np.arange(y.size)
    edges = np.linspace(0, y.size, bins + 1).astype(np.int64)
    rows = [at + f(y[at:to]) for at, to in itertools.pairwise(edges) for f in (np.argmin, np.argmax)]
    return np.unique(np.array(rows, np.int64))
