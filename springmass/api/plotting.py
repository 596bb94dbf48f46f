"""The report's charts, drawn into the caller's axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.analyse import Analysis, Oscillation
from pipeline.errors import AnalysisError
from springmass.charts.chart import Chart
from springmass.charts.draw import draw
from springmass.charts.run import CHARTS, amplitude

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True)
class Plot:
    """The charts of an analysis: ``run.plot("amplitude", ax=ax)``, or ``run.plot.amplitude(ax=ax)``.

    Each draws its main panel into ``ax``, a matplotlib ``Axes``, in the caller's style, and returns it; without ``ax``
    it makes a new pyplot figure. The names are those of :data:`springmass.charts.run.CHARTS`.
    """

    analysis: Analysis

    def __call__(self, chart: str = "position", ax: Axes | None = None) -> Axes:
        """Draw a chart by name."""
        if chart not in CHARTS:
            raise AnalysisError(f"no chart {chart!r}; there are {', '.join(CHARTS)}")
        return self._drawn(CHARTS[chart](self.analysis), chart, ax)

    def position(self, ax: Axes | None = None, *, from_s: float | None = None, to_s: float | None = None) -> Axes:
        """Draw the distance against time with its fit, from one time to another."""
        panel, t = self("position", ax), self.analysis.track.t
        panel.set_xlim(np.nanmin(t) if from_s is None else from_s, np.nanmax(t) if to_s is None else to_s)
        return panel

    def amplitude(self, ax: Axes | None = None, *, laws: Sequence[str] | None = None) -> Axes:
        """Draw the amplitude against time with the damping laws of these names, or with all that were fitted."""
        motion = self.analysis.motion
        fits = motion.damping.fits if isinstance(motion, Oscillation) else {}
        if missing := [name for name in laws or () if fits and name not in fits]:
            raise AnalysisError(f"no law {missing[0]!r} was fitted to this run; there are {', '.join(fits)}")
        return self._drawn(amplitude(self.analysis, laws), "amplitude", ax)

    def phase(self, ax: Axes | None = None) -> Axes:
        """Draw velocity against displacement."""
        return self("phase", ax)

    def energy(self, ax: Axes | None = None) -> Axes:
        """Draw the mechanical energy against time with its uncertainty band."""
        return self("energy", ax)

    def drag(self, ax: Axes | None = None) -> Axes:
        """Draw the drag coefficient against amplitude with its uncertainty band."""
        return self("drag", ax)

    def _drawn(self, chart: Chart | None, name: str, ax: Axes | None) -> Axes:
        if chart is None:
            motion = self.analysis.motion
            if not isinstance(motion, Oscillation):
                raise ValueError(f"only the position of this recording can be drawn, nothing oscillates: {motion.why}")
            needs = "[bob] mass_kg, [disc] diameter_m and an amplitude that falls" if name == "drag" else "more periods"
            raise AnalysisError(f"the chart {name} needs {needs}; state them in the scene, or record longer")
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(layout="constrained")[1]
        draw(chart.panels[0], ax)
        ax.legend(fontsize="small")
        return ax
