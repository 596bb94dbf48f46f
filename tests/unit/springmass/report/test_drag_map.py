"""The map of drag draws what the runs give, beside lines that are those of the literature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from springmass.report.figures.drag_map import DragRun, drag_map_figure, drag_of_disc_at_rest, drag_of_plate


def test_a_disc_in_a_steady_stream_has_its_two_limits() -> None:
    """Oberbeck's force 16 eta a v over half the density, v squared and the area; 1.17 at high Reynolds numbers."""
    rho, eta, radius, velocity = 1.2, 1.8e-5, 0.05, 1e-6
    force = 16.0 * eta * radius * velocity
    coefficient = force / (0.5 * rho * velocity**2 * math.pi * radius**2)
    reynolds = rho * velocity * 2.0 * radius / eta
    assert drag_of_disc_at_rest(np.array([reynolds, 1e4])).tolist() == pytest.approx([coefficient, 1.17])


def test_an_oscillating_plate_falls_with_the_cube_root_to_its_steady_value() -> None:
    """10 at KC = 1, half of it at 8, 1.95 from 135 on."""
    assert drag_of_plate(np.array([1.0, 8.0, 134.0, 136.0])).tolist() == pytest.approx(
        [10.0, 5.0, 1.954, 1.95], rel=1e-3
    )


@pytest.mark.parametrize("width", [7.2, 3.4])
def test_every_point_lies_in_both_panels(width: float) -> None:
    """Against Re and against KC, with its band, a colour a disc; on a narrow figure beneath each other."""
    points = np.array([[100.0, 1.0, 6.0, 0.3], [300.0, 3.0, 4.0, 0.2]])
    other = points * (3.0, 2.0, 0.5, 1.0)
    figure = drag_map_figure([DragRun("small", points), DragRun("large", other), DragRun("small", points)], width=width)
    assert len(figure.axes) == 2
    for column, panel in enumerate(figure.axes):
        drawn = [line.get_xydata() for line in panel.lines[:3]]
        for run, line in zip((points, other, points), drawn, strict=True):
            assert np.array_equal(line, run[:, [column, 2]])
        assert panel.lines[0].get_color() == panel.lines[2].get_color() != panel.lines[1].get_color()
        band = panel.collections[0].get_paths()[0].vertices
        assert band[:, 1].min() == pytest.approx(3.8)
        assert band[:, 1].max() == pytest.approx(6.3)
        low, high = panel.get_ylim()
        assert low < 2.0 < 6.3 < high
    places = [panel.get_position() for panel in figure.axes]
    assert (places[0].y0 > places[1].y1) == (width < 5.0)


def test_runs_without_drag_make_no_map() -> None:
    """One positive coefficient is needed."""
    with pytest.raises(ValueError, match="positive drag coefficient"):
        drag_map_figure([DragRun("", np.array([[100.0, 1.0, -6.0, 0.3]]))])
