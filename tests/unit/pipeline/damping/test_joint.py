"""Several runs of one bob tell one set of coefficients, or that there is none."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.damping.joint import fit_joint
from pipeline.damping.laws import LAWS
from pipeline.damping.select import Damping, Params, fit_damping
from pipeline.errors import AnalysisError
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
T = 0.4 + 0.757 * np.arange(80)  # one minute
MIXED = {"gamma": 0.0073, "beta": 0.235}


def run(
    synthetic: ModuleType, windows: Windows, seed: int, u_m: float = 5e-5, **truth: float
) -> tuple[str, Demodulated, Damping]:
    """Return one run that begins at t = 100 s under its name."""
    clean = synthetic.Truth(**truth).amplitude_at(T)
    noisy = clean + np.random.default_rng(seed).normal(0.0, u_m, T.size)
    points = windows(T + 100.0, noisy, u=(u_m, 1e-4, 1e-5))
    return f"run {seed}", points, fit_damping(points, 100.0)


def test_shared_coefficients_are_held_and_better_known(synthetic: ModuleType, windows: Windows) -> None:
    """Over 30 triples of runs the joint intervals cover the truth, and are narrower than those of any run alone."""
    pulls = []
    for seed in range(30):
        runs = [
            run(synthetic, windows, 3 * seed + k, amplitude=start, **MIXED)
            for k, start in enumerate((0.05, 0.03, 0.02))
        ]
        joint = fit_joint(runs)
        assert joint.one_law
        assert "linear+quadratic" in joint.admissible
        fit = joint.fits["linear+quadratic"]
        for name, true in MIXED.items():
            found = fit.coefficients[name]
            assert found.u < min(damping.fits["linear+quadratic"].joint[name].u for _, _, damping in runs)
            pulls.append((found.value - true) / found.u)
        for found, start in zip(fit.amplitudes, (0.05, 0.03, 0.02), strict=True):
            assert abs(found.value - start) < 5.0 * found.u
    assert 0.75 < np.std(pulls) < 1.3
    assert fit.excess_dof == 4.0


def test_runs_together_settle_the_law(synthetic: ModuleType, windows: Windows) -> None:
    """Two runs whose amplitudes lie apart reject a law that either alone admits."""
    runs = [run(synthetic, windows, k, u_m=3e-4, amplitude=start, **MIXED) for k, start in enumerate((0.05, 0.01))]
    joint = fit_joint(runs)
    assert any("linear" in damping.admissible for _, _, damping in runs)
    assert joint.fits["linear"].rejected
    assert joint.selected == "linear+quadratic"
    assert joint.runs == ("run 0", "run 1")
    assert "linear and quadratic drag" in joint.message
    assert "run 0, run 1" in joint.message


def test_different_coefficients_are_told(synthetic: ModuleType, windows: Windows) -> None:
    """Runs that each follow the exponential, with rates ten per cent apart, have no common law of it."""
    runs = [run(synthetic, windows, k, gamma=gamma) for k, gamma in enumerate((0.0146, 0.0161))]
    joint = fit_joint(runs, Params(laws=("none", "linear")))
    assert joint.fits["linear"].rejection in ("differ", "misfit")
    assert not joint.one_law
    assert joint.admissible == ()
    assert joint.best.law.name == "linear"
    assert "run 0, run 1" in joint.message


def test_equal_coefficients_are_hardly_ever_denied(synthetic: ModuleType, windows: Windows) -> None:
    """Of 100 pairs of like runs at most two are said to differ, where one in a thousand should be."""
    denied = 0
    for seed in range(100):
        pair = [run(synthetic, windows, 2 * seed + k, amplitude=0.05 - 0.02 * k, gamma=0.0146) for k in range(2)]
        denied += fit_joint(pair, Params(laws=("linear",))).fits["linear"].rejected
    assert denied <= 2


@pytest.mark.parametrize("length_m", [1e-9, 1e3])
def test_any_size_will_do(windows: Windows, length_m: float) -> None:
    """Amplitudes of nanometres and of kilometres give the same rates."""
    runs = []
    for k, start in enumerate((1.0, 0.5)):
        noise = np.random.default_rng(k).normal(0.0, 1e-3, T.size)
        points = windows(T, length_m * (start * np.exp(-0.0146 * T) + noise), u=(1e-3 * length_m, 1e-4, 1e-5))
        runs.append((f"{k}", points, fit_damping(points, 0.0)))
    gamma = fit_joint(runs).fits["linear"].coefficients["gamma"]
    assert abs(gamma.value - 0.0146) < 4.0 * gamma.u
    assert gamma.unit == "1/s"


def test_one_run_is_not_enough(synthetic: ModuleType, windows: Windows) -> None:
    """A joint fit of one run, or of runs without a common law, is refused in one line."""
    alone = run(synthetic, windows, 1, gamma=0.01)
    with pytest.raises(AnalysisError, match="two runs at least, got 1"):
        fit_joint([alone])
    with pytest.raises(AnalysisError, match="nothing to join"):
        fit_joint([alone, alone], Params(laws=()))


def test_laws_that_ship_may_be_given_as_objects(synthetic: ModuleType, windows: Windows) -> None:
    """The options of a fit take a law by its name or itself, in a joint fit as in that of one run."""
    runs = [run(synthetic, windows, seed, **MIXED) for seed in (1, 2)]
    by_object = fit_joint(runs, Params(laws=(LAWS["none"], LAWS["linear"])))
    assert set(by_object.fits) == {"none", "linear"}
