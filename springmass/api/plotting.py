"""The report's figures, drawn into axes of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipeline.analyse import Analysis
from pipeline.errors import AnalysisError
from springmass.report.figures.amplitude import amplitude_panel
from springmass.report.figures.energy_drag import drag_panel, energy_panel
from springmass.report.figures.phase_plot import phase_panel
from springmass.report.figures.position import position_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Plot"]


@dataclass(frozen=True, slots=True)
class Plot:
    """The figures of an analysis.

    Every one takes ``ax``, a matplotlib ``Axes`` to draw into, and returns it; left out, a new figure of pyplot is
    made. What is drawn is the report's main panel, in the reader's own style.

    Parameters
    ----------
    analysis : Analysis
    """

    analysis: Analysis

    def __call__(self, ax: Axes | None = None) -> Axes:
        """Draw the distance with its fit; as :meth:`position`."""
        return self.position(ax=ax)

    def position(self, ax: Axes | None = None, *, from_s: float | None = None, to_s: float | None = None) -> Axes:
        """Draw the distance against time with its fit; flagged samples have other markers.

        Parameters
        ----------
        ax : Axes, optional
        from_s, to_s : float, optional
            Of these seconds only.
        """
        panel, t = _axes(ax), self.analysis.track.t
        start = float(np.nanmin(t)) if from_s is None else from_s
        position_panel(panel, self.analysis, start, float(np.nanmax(t)) if to_s is None else to_s)
        return _finished(panel, "time / s")

    def amplitude(self, ax: Axes | None = None, *, laws: Sequence[str] | None = None) -> Axes:
        """Draw the amplitude against time with the damping laws.

        Parameters
        ----------
        ax : Axes, optional
        laws : sequence of str, optional
            Names of those to draw; left out, all that were fitted.

        Raises
        ------
        AnalysisError
            If a law was not fitted.
        ValueError
            If nothing oscillates.
        """
        panel = _axes(ax)
        amplitude_panel(panel, self.analysis, laws)
        return _finished(panel, "time / s")

    def phase(self, ax: Axes | None = None) -> Axes:
        """Draw velocity against displacement, the time as a colour.

        Raises
        ------
        ValueError
            If nothing oscillates.
        """
        panel = _axes(ax)
        times = phase_panel(panel, self.analysis)
        panel.figure.colorbar(times, ax=panel, label="time / s")
        return _finished(panel, "displacement / mm")

    def energy(self, ax: Axes | None = None) -> Axes:
        """Draw the mechanical energy against time with its band.

        Raises
        ------
        ValueError
            If nothing oscillates.
        """
        panel = _axes(ax)
        energy_panel(panel, self.analysis)
        return _finished(panel, "time / s")

    def drag(self, ax: Axes | None = None) -> Axes:
        """Draw the drag coefficient against amplitude with its band.

        Raises
        ------
        AnalysisError
            If scene or record give none.
        ValueError
            If nothing oscillates.
        """
        panel = _axes(ax)
        if not drag_panel(panel, self.analysis):
            raise AnalysisError(
                "a drag coefficient needs [bob] mass_kg, [disc] diameter_m and an amplitude that falls; state them in "
                "the scene"
            )
        return _finished(panel, "amplitude / mm")


def _axes(ax: Axes | None) -> Axes:
    """Return the axes given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def _finished(panel: Axes, label: str) -> Axes:
    panel.set_xlabel(label)
    panel.legend(fontsize="small")
    return panel
