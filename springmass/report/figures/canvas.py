"""What all figures share: style, panels, legends, and the bytes of a file.

Colours are those of Okabe and Ito, told apart by line style or marker as well. The same figure gives the same bytes:
no dates, no random identifiers.
"""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import visible
from pipeline.analyse import Analysis, Oscillation
from pipeline.numerics.quantity import SHOWN, in_unit
from pipeline.track import F8
from springmass.report.tables import page_unit
from storage.atomic import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BLUE",
    "BOTTOM",
    "DENSE_POINTS",
    "GREEN",
    "GREY",
    "KINDS",
    "ORANGE",
    "PURPLE",
    "RASTER_POINTS",
    "RIGHT",
    "SKY",
    "VERMILLION",
    "WIDTH",
    "blank",
    "derivative_label",
    "error_bars",
    "escaped",
    "finish_residual",
    "legend_above",
    "legend_row",
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
_SETTINGS: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.markerscale": 1.8,
    "lines.linewidth": 1.0,
    "path.simplify": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "springmass",
    "pdf.fonttype": 42,
    "savefig.dpi": 150,
}
WIDTH = 7.2  # inches, as all lengths here
LEFT, RIGHT, BOTTOM = 0.72, 0.12, 0.45
SHORT = 4  # characters of a number that fits beside an axis whatever they are
DENSE_POINTS = 2500  # of samples; more are a line between the least and the greatest of every bin
RASTER_POINTS = 300  # of markers; more are pixels in the file, fewer bytes than as many shapes
KINDS: tuple[Literal["svg"], Literal["pdf"]] = ("svg", "pdf")


def render(figure: Figure, kind: Literal["svg", "pdf"]) -> bytes:
    """Return a figure as the bytes of a file, the same at every call.

    Parameters
    ----------
    figure : Figure
    kind : {"svg", "pdf"}
    """
    metadata = {
        "svg": {"Date": None, "Creator": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }
    out = io.BytesIO()
    with style():
        _shrink_wide_numbers(figure)
        figure.savefig(out, format=kind, metadata=metadata[kind])
    return _cut(out.getvalue()) if kind == "svg" else out.getvalue()


def _cut(svg: bytes) -> bytes:
    """Cut the numbers of an SVG file's paths to tenths of a point, a sixth of a screen's pixel; text and pixels stay.

    To round them takes four times as long.
    """
    paths = re.sub(rb' d="[^"]*"', lambda path: _BEYOND_TENTHS.sub(b"", b" " + b" ".join(path[0].split())), svg)
    return re.sub(rb' (?:x|y|transform)="[^"]*"', lambda found: _BEYOND_HUNDREDTHS.sub(b"", found[0]), paths)


# What is replaced by nothing needs no template, which the library fills in by a call of Python's for every number.
_BEYOND_TENTHS, _BEYOND_HUNDREDTHS = re.compile(rb"(?<=\.\d)\d+"), re.compile(rb"(?<=\.\d\d)\d+")


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write a figure as SVG and as PDF, each file whole or not at all."""
    for kind in KINDS:
        write_whole(folder / f"{name}.{kind}", render(figure, kind))


def _shrink_wide_numbers(figure: Figure) -> None:
    """Print the numbers at an axis smaller where they would run into its label."""
    room = 0.38 * figure.dpi
    for axes in figure.axes:
        if not axes.get_xlabel():
            axes.xaxis.set_label_coords(0.5, 0.0)  # else room for it is sought, which takes as long as to draw the axis
        if not axes.get_ylabel():
            continue
        labels = [label for label in axes.get_yticklabels() if len(label.get_text()) > SHORT]
        widest = max((label.get_window_extent().width for label in labels), default=0.0)
        if widest > room:
            size = _SETTINGS["font.size"] * room / widest
            axes.tick_params(axis="y", labelsize=max(size, 6.0))


@contextmanager
def style() -> Iterator[None]:
    """Draw or save in the report's style, whatever the reader's own settings."""
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context():
        # A reader's own matplotlibrc must not change the report.
        rcdefaults()
        rcParams.update(_SETTINGS)
        yield


def blank(width: float, height: float) -> Figure:
    """Return a figure of this size, inches, that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def legend_row(panel: Axes, columns: int, *, pad: float = 0.2, **look: Any) -> None:
    """Put a legend of so many columns above a panel, left edges aligned."""
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=pad, **look)


def panels(
    rows: Sequence[tuple[float, float]], *, width: float = WIDTH, right: float = RIGHT, top: float = 0.12
) -> tuple[Figure, list[Axes]]:
    """Make panels under each other, each of a height and a gap above it in inches, left edges aligned."""
    from matplotlib import rc_context

    from springmass.report.figures.grid import draw_grid

    height = BOTTOM + top + sum(sum(row) for row in rows)
    figure = blank(width, height)
    axes, at = [], height - top
    with rc_context({"axes.grid": False, "xtick.bottom": False, "ytick.left": False}):
        for tall, gap in rows:
            at -= tall + gap
            panel = figure.add_axes((LEFT / width, at / height, (width - LEFT - right) / width, tall / height))
            draw_grid(panel, colour=_SETTINGS["grid.color"], width=_SETTINGS["grid.linewidth"])
            panel.yaxis.set_label_coords(-0.5 / (width - LEFT - right), 0.5)
            axes.append(panel)
    return figure, axes


def moving(analysis: Analysis) -> Oscillation:
    """Return what moves; ValueError where nothing oscillates."""
    if not isinstance(analysis.motion, Oscillation):
        raise ValueError(f"only the position of this record can be drawn, nothing oscillates: {analysis.motion.why}")
    return analysis.motion


def legend_above(panel: Axes, *, handle: float = 1.5) -> None:
    """Put the legend above a figure's first panel, in as few rows as hold it, and make the paper as much taller."""
    figure = panel.get_figure(root=True)
    assert figure is not None
    # What was measured comes first, though matplotlib lists error bars last.
    entries = list(zip(*panel.get_legend_handles_labels(), strict=True))
    entries.sort(key=lambda entry: not entry[1].startswith(("samples", "amplitude")))
    handles, labels = [entry[0] for entry in entries], [entry[1] for entry in entries]
    rows = 1
    for rows in range(1, len(labels) + 1):
        legend = panel.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=-(-len(labels) // rows),
            borderaxespad=0.2,
            columnspacing=1.4,
            handletextpad=0.5,
            handlelength=handle,
        )
        if legend.get_window_extent().width <= panel.get_window_extent().width:
            break
    before = figure.get_figheight()
    after = before + 0.2 * rows
    for axes in figure.axes:
        at = axes.get_position()
        axes.set_position((at.x0, at.y0 * before / after, at.width, at.height * before / after))
    figure.set_figheight(after)


def finish_residual(panel: Axes, residual: F8, label: str) -> None:
    """Give a panel of residuals its zero line and a range that is symmetric about it."""
    reach = max(3.5, 1.1 * float(np.max(np.abs(residual), initial=0.0)))
    panel.set_ylim(-reach, reach)
    panel.axhline(0.0, color="#000000", lw=0.8)
    panel.set_ylabel(label)


def share(above: Axes, below: Axes, start: float, end: float) -> None:
    """Let two panels share their axis of time, numbered beneath the lower one."""
    below.sharex(above)
    above.xaxis.set_visible(False)
    above.set_xlim(start, end)


def error_bars(
    panel: Axes, x: F8, y: F8, u: F8, label: str | None, *, size: float = 3.4, width: float = 0.9, color: str = SKY
) -> None:
    """Set points with their standard uncertainties: all bars are one line with gaps, a path in place of hundreds."""
    bars = np.column_stack([y - u, y + u, np.full(y.shape, np.nan)])
    panel.plot(np.repeat(x, 3), bars.ravel(), color=BLUE, lw=width, solid_capstyle="butt")
    panel.plot(x, y, "o", ms=size, mew=0, color=color, label=label)


def escaped(text: str) -> str:
    """Return a text from outside, its control characters visible, for matplotlib to set as it stands."""
    return visible(text).replace("$", r"\$")  # else what stands between two is set as mathematics


def value_label(what: str, unit: str) -> str:
    """Return the label of an axis in the unit that values of a record are shown in.

    Examples
    --------
    >>> value_label("amplitude", "m"), value_label("amplitude", "m/s^2")
    ('amplitude / mm', 'amplitude / (m/s²)')
    """
    own = SHOWN[unit].unit
    return f"{what} / {_in_brackets(own)}" if own else what


def derivative_label(what: tuple[str, str], form: str, unit: str) -> str:
    """Return the label of an axis of a derivative: its name for a length and otherwise, its unit for a length.

    Examples
    --------
    >>> derivative_label(("velocity", "rate"), "m/s", "m"), derivative_label(("velocity", "rate"), "m/s", "rad")
    ('velocity / (m/s)', 'rate / (rad/s)')
    """
    return f"{what[unit != 'm']} / {_in_brackets(in_unit(form, unit))}"


def _in_brackets(unit: str) -> str:
    shown = page_unit(unit)
    return f"({shown})" if "/" in shown else shown


def model_phase(motion: Oscillation, t: F8) -> tuple[F8, F8]:
    """Fitted displacement and velocity at times t, in the record's unit and in that over s."""
    law, angle = motion.damping.best, motion.phase.total(t)
    amplitude = law.amplitude(t - motion.phase.t0)
    cosine, sine = np.cos(angle), np.sin(angle)
    velocity = -law.law.rate(amplitude, law.joint.values) * cosine - amplitude * motion.phase.rate(amplitude) * sine
    return amplitude * cosine, velocity


def thinned(y: F8, bins: int) -> NDArray[np.int64]:
    """Return the rows of the least and the greatest of every bin: on paper of that many pixels nothing is lost."""
    if y.size <= 2 * bins:
        return np.arange(y.size)
    edges = np.linspace(0, y.size, bins + 1).astype(np.int64)
    rows = [at + f(y[at:to]) for at, to in itertools.pairwise(edges) for f in (np.argmin, np.argmax)]
    return np.unique(np.array(rows, np.int64))
