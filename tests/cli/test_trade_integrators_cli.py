"""The trade of integrators: what is measured, told and drawn."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.dynamics import INTEGRATORS
from springmass.report.figures import render
from springmass.trade import integrators
from springmass.trade.drawing import integrators_figure

REFERENCE = 1e-9  # of the amplitude: what DOP853 at 1e-13 errs by itself where drag has a kink


@pytest.fixture(scope="module")
def rows() -> list[integrators.Work]:
    """Return a short measurement, by a clock that ticks once a call."""
    ticks = itertools.count()
    return integrators.measure_integrators(lambda: float(next(ticks)), count=200, rounds=1)


def test_every_integrator_is_measured_on_what_it_can_solve(rows: list[integrators.Work]) -> None:
    """Every name appears, the exact propagator on the linear scene alone, each with the clock's time."""
    by_scene = {scene: {row.method for row in rows if row.scene == scene} for scene in integrators.SCENES}
    assert by_scene["linear"] == set(INTEGRATORS)
    assert by_scene["mixed drag"] == set(INTEGRATORS) - {"exact"}
    assert all(row.seconds == 1.0 for row in rows)  # halvings too: they take the clock of auto


def test_auto_is_marked_at_each_tolerance_and_keeps_it(rows: list[integrators.Work]) -> None:
    """Each scene has a choice for every tolerance that can be kept, and its error is within."""
    for scene in integrators.SCENES:
        chosen = {row.tolerance: row.error for row in rows if row.scene == scene and row.tolerance is not None}
        assert {1e-2, 1e-4, 1e-6, 1e-8} <= set(chosen) <= set(integrators.TOLERANCES)
        assert all(error <= tolerance + REFERENCE for tolerance, error in chosen.items())


def test_finer_steps_err_less(rows: list[integrators.Work]) -> None:
    """The curves fall: of the methods of an order on mixed drag, the finest step errs least."""
    for name in ("symplectic-euler", "verlet", "yoshida4", "rk4", "strang"):
        own = [r.error for r in rows if r.scene == "mixed drag" and r.method == name and r.tolerance is None]
        assert own == sorted(own, reverse=True)


def test_the_figure_names_and_rings(rows: list[integrators.Work]) -> None:
    """Every method stands in the legend, and so do the choices."""
    text = render(integrators_figure(rows), "svg").decode()
    assert all(
        re.search(rf">{re.escape(name)}<", text) for name in [*INTEGRATORS, "taken by auto", *integrators.SCENES]
    )


def test_the_command_prints_writes_and_refuses(
    cli: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: list[integrators.Work]
) -> None:
    """A table or JSON on stdout, figure and JSON in the folder; options of simulated records are refused."""
    monkeypatch.setattr(integrators, "measure_integrators", lambda *_, **__: rows)
    done = cli("trade", "--integrators", "--out", tmp_path / "out")
    assert done.code == 0
    assert "auto 1e-06" in done.out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        f"integrators.{kind}" for kind in ("svg", "pdf", "json")
    }
    (result,) = cli("trade", "--integrators", "--json").results
    assert result == json.loads((tmp_path / "out" / "integrators.json").read_text())
    assert result["integrators"][0].keys() == {"scene", "method", "setting", "error", "seconds", "tolerance"}
    refused = cli("trade", "--integrators", "--seeds", "5")
    assert refused.code == 2
    assert "--integrators measures trajectories" in refused.complaint
