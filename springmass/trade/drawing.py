"""The trade drawn: error against time, the Pareto front, and what lies above it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from springmass.report.figures.canvas import BLUE, GREY, VERMILLION, legend_row, panels, style
from springmass.trade.front import Point, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

__all__ = ["trade_figure"]

TALL, GAP = 2.2, 0.22
# Where a name may stand, in points from its mark, the most wanted place first.
BESIDE = [(7, 0, "left"), (-7, 0, "right")] + [
    (right, up, side)
    for far in (10, 19, 28)
    for up in (far, -far)
    for right, side in ((0, "center"), (7, "left"), (-7, "right"), (22, "left"), (-22, "right"))
]

# A name that stands off points to its mark.
_POINTER: dict[str, Any] = {"arrowstyle": "-", "lw": 0.5, "color": GREY, "shrinkA": 0, "shrinkB": 3}


def trade_figure(
    quantities: Mapping[str, Sequence[Point]],
    *,
    labels: Mapping[str, str],
    cost_label: str = "time for one record / ms",
    cost_factor: float = 1e3,
    floor: float | None = 1.0,
    ceiling: float | None = 30.0,
) -> Figure:
    """Draw a panel a quantity, one above the other: error against cost, both logarithmic.

    Parameters
    ----------
    quantities : mapping of str to sequence of Point
        Those of the group "tier" stand out.
    labels : mapping of str to str
        Of the panels' vertical axes.
    cost_label, cost_factor : str, float
        Of the horizontal axis, and what a cost is multiplied with for it.
    floor : float, optional
        Error that nothing can go below, drawn as a line.
    ceiling : float, optional
        Errors above stand at the upper edge, with their value.
    """
    costs = [point.cost * cost_factor for points in quantities.values() for point in points]
    with style():
        figure, axes = panels([(TALL, GAP if i else 0.0) for i in range(len(quantities))], top=0.3)
        for axis, (name, points) in zip(axes, quantities.items(), strict=True):
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_xlim(min(costs) / 2.0, max(costs) * 3.0)
            _limit(axis, points, floor, ceiling)
            axis.set_ylabel(labels[name])
            axis.yaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_major_formatter("{x:g}")
            if axis is not axes[-1]:
                axis.tick_params(labelbottom=False)
            _draw(axis, points, cost_factor, floor)
        axes[-1].set_xlabel(cost_label)
        _keys(axes[0])
        figure.canvas.draw()
        for axis, points in zip(axes, quantities.values(), strict=True):
            _Names(axis, points, cost_factor, floor).write()
        return figure


def _limit(axis: Axes, points: Sequence[Point], floor: float | None, ceiling: float | None) -> None:
    errors = [point.error for point in points] + ([] if floor is None else [floor])
    top = max(errors) if ceiling is None else min(max(errors), ceiling)
    axis.set_ylim(min(errors) / 2.5, top * 1.8)


def _seen(axis: Axes, point: Point, factor: float) -> tuple[float, float]:
    """Where a point is drawn: at the upper edge if it lies above."""
    return point.cost * factor, min(point.error, axis.get_ylim()[1])


def _draw(axis: Axes, points: Sequence[Point], factor: float, floor: float | None) -> None:
    if floor is not None:
        axis.axhline(floor, color=GREY, lw=0.8, ls=(0, (4, 2)), zorder=1)
    edge = front(points)
    x, y = zip(*(_seen(axis, point, factor) for point in edge), strict=True)
    axis.plot(x, y, color=BLUE, lw=0.9, zorder=2, drawstyle="steps-post")
    for point in points:
        colour, marker = (VERMILLION, "D") if point.group == "tier" else (BLUE, "o")
        x_of, y_of = _seen(axis, point, factor)
        style: dict[str, Any] = {"ms": 5.5, "mew": 1.0, "color": colour, "clip_on": False, "zorder": 4}
        axis.plot([x_of], [y_of], marker, mfc=colour if point in edge else "#ffffff", **style)


def _keys(axis: Axes) -> None:
    """Set the legend above the first panel."""
    from matplotlib.lines import Line2D

    marks = [("D", VERMILLION, VERMILLION), ("o", BLUE, BLUE), ("o", BLUE, "#ffffff")]
    handles = [Line2D([], [], marker=m, ls="", ms=5, mew=1.0, color=colour, mfc=face) for m, colour, face in marks]
    handles += [Line2D([], [], color=BLUE, lw=0.9), Line2D([], [], color=GREY, lw=0.8, ls=(0, (4, 2)))]
    labels = ["springmass tier", "reference", "hollow: beaten in time and error", "Pareto front", "bound"]
    look = {"columnspacing": 1.4, "handletextpad": 0.4, "handlelength": 1.5, "markerscale": 1.0}
    legend_row(axis, len(handles), handles=handles, labels=labels, **look)


class _Names:
    """Names beside points, each where it covers no mark, no line and no other name, or the least of them."""

    def __init__(self, axis: Axes, points: Sequence[Point], factor: float, floor: float | None) -> None:
        from matplotlib import transforms

        figure = axis.get_figure(root=True)
        assert figure is not None
        self._axis, self._points, self._factor = axis, points, factor
        reach = 4.0 * figure.dpi / 72.0
        marks = [axis.transData.transform(_seen(axis, point, factor)) for point in points]
        self._taken = [transforms.Bbox.from_bounds(x - reach, y - reach, 2 * reach, 2 * reach) for x, y in marks]
        if floor is not None:
            height, room = axis.transData.transform((1.0, floor))[1], axis.get_window_extent()
            self._taken.append(transforms.Bbox([[room.x0, height - 1], [room.x1, height + 1]]))
        edge = [axis.transData.transform(_seen(axis, point, factor)) for point in front(points)]
        for (x0, y0), (x1, y1) in itertools.pairwise(edge):
            lines = [[x0, y0 - 1], [x1, y0 + 1]], [[x1 - 1, min(y0, y1)], [x1 + 1, max(y0, y1)]]
            self._taken += [transforms.Bbox(line) for line in lines]

    def write(self) -> None:
        """Write all, from the top downwards."""
        for point in sorted(self._points, key=lambda each: -each.error):
            best = min(range(len(BESIDE)), key=lambda rank: (self._covered(point, rank), rank))
            self._taken.append(self._extent(self._write(point, best)))

    def _covered(self, point: Point, rank: int) -> int:
        """Return how many things a name would cover at one of the places; far too many outside the panel."""
        text = self._write(point, rank)
        box, room = self._extent(text), self._axis.get_window_extent()
        text.remove()
        inside = room.x0 <= box.x0 and box.x1 <= room.x1 and room.y0 <= box.y0 and box.y1 <= room.y1
        return sum(bool(box.overlaps(other)) for other in self._taken) + (0 if inside else 1000)

    @staticmethod
    def _extent(text: Annotation) -> Bbox:
        """Return where the letters stand, without the pointer."""
        from matplotlib.text import Text

        text.get_window_extent()  # puts it in its place
        return Text.get_window_extent(text)

    def _write(self, point: Point, rank: int) -> Annotation:
        right, up, side = BESIDE[rank]
        place = _seen(self._axis, point, self._factor)
        beyond = f" ({point.error:.0f})" if point.error > place[1] else ""
        return self._axis.annotate(
            point.name + beyond,
            place,
            (right, up - (7 if beyond and not up else 0)),
            textcoords="offset points",
            ha=side,
            va="center",
            fontsize=8,
            color=VERMILLION if point.group == "tier" else "#000000",
            arrowprops=_POINTER if abs(up) > 8 else None,
            annotation_clip=False,
        )
