"""The report's figures, drawn into the caller's axes."""

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

    Every method draws into ``ax``, a matplotlib ``Axes``, and returns it; without ``ax`` it makes a new pyplot figure.
    It draws the main panel of the report's figure in the caller's matplotlib style.

    Parameters
    ----------
    analysis : Analysis
    """

    analysis: Analysis

    def __call__(self, ax: Axes | None = None) -> Axes:
        """Draw the distance with its fit, as :meth:`position` does."""
        return self.position(ax=ax)

    def position(self, ax: Axes | None = None, *, from_s: float | None = None, to_s: float | None = None) -> Axes:
        """Draw the distance against time with its fit; flagged samples have other markers.

        Parameters
        ----------
        ax : Axes, optional
        from_s, to_s : float, optional
            Limits of the time range to draw, s; default: the whole run.
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
            Names of the laws to draw; default: all that were fitted.

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
        """Draw velocity against displacement, with the time as colour.

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
        """Draw the mechanical energy against time with its uncertainty band.

        Raises
        ------
        ValueError
            If nothing oscillates.
        """
        panel = _axes(ax)
        energy_panel(panel, self.analysis)
        return _finished(panel, "time / s")

    def drag(self, ax: Axes | None = None) -> Axes:
        """Draw the drag coefficient against amplitude with its uncertainty band.

        Raises
        ------
        AnalysisError
            If the scene or the recording does not determine a drag coefficient.
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
    """Return the given axes, or the axes of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def _finished(panel: Axes, label: str) -> Axes:
    panel.set_xlabel(label)
    panel.legend(fontsize="small")
    return panel
