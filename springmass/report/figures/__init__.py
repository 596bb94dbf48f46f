"""Figures of a report: position and residuals, amplitude and laws, velocity and acceleration, drag, energy, phase plot.

Every maker takes an analysis and returns a matplotlib ``Figure`` that belongs to no window, or None if the record or
its scene lacks the data to draw. To keep the page small, long series are thinned to what the eye can see, or rasterized
inside the vector file. A further figure needs a maker and a line in :data:`MAKERS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from pipeline.analyse import Analysis, Oscillation
from pipeline.results.classic import Classic
from pipeline.results.kinematics import Smoothed
from springmass.report.figures.amplitude import amplitude_figure, amplitude_log_figure
from springmass.report.figures.canvas import KINDS, render, save
from springmass.report.figures.classic_method import classic_figure
from springmass.report.figures.comparison import comparison_figure
from springmass.report.figures.energy_drag import drag_figure, energy_figure
from springmass.report.figures.frequency import frequency_figure, spectrum_figure
from springmass.report.figures.overlay import overlay_figure
from springmass.report.figures.phase_plot import phase_figure
from springmass.report.figures.position import position_figure
from springmass.report.figures.velocity import motion_figure
from springmass.report.recorded import Note

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "KINDS",
    "MAKERS",
    "NAMES",
    "amplitude_figure",
    "amplitude_log_figure",
    "classic_figure",
    "comparison_figure",
    "drag_figure",
    "draw",
    "energy_figure",
    "frequency_figure",
    "motion_figure",
    "overlay_figure",
    "phase_figure",
    "position_figure",
    "render",
    "save",
    "spectrum_figure",
]

MAKERS: dict[str, Callable[[Analysis], Figure | None]] = {
    "position": position_figure,
    "amplitude": amplitude_figure,
    "logarithmic": amplitude_log_figure,
    "frequency": frequency_figure,
    "spectrum": spectrum_figure,
    "drag": drag_figure,
    "energy": energy_figure,
    "motion": motion_figure,
    "phase": phase_figure,
}


NAMES = (*MAKERS, "classic")
"""Names of all figures that a run's report may contain."""


def draw(
    analysis: Analysis,
    smoothed: Smoothed | str | None = None,
    *,
    notes: Sequence[Note] = (),
    classic: Classic | None = None,
) -> dict[str, Figure]:
    """Return all figures of a run by name, in the report's order; only the position if nothing oscillates.

    Parameters
    ----------
    analysis : Analysis
    smoothed : Smoothed or str, optional
        The run's ``smoothed()``, or why there is none; calculated if omitted.
    notes : sequence of Note
        Marks and events of the recording, for the position.
    classic : Classic, optional
        The lab report's own method on the same record; if given, its figure is included.
    """
    if not isinstance(analysis.motion, Oscillation):
        return {"position": position_figure(analysis, notes)}
    makers = MAKERS | {"position": partial(position_figure, notes=notes)}
    if isinstance(smoothed, str):
        del makers["motion"]
    else:
        smoothed = analysis.smoothed() if smoothed is None else smoothed
        makers["motion"] = partial(motion_figure, smoothed=smoothed)
        makers["energy"] = partial(energy_figure, smoothed=smoothed)
    if classic is not None:
        makers["classic"] = partial(classic_figure, classic=classic)
    drawn = {name: maker(analysis) for name, maker in makers.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}
