"""Several runs agree on one spring, or it is said which two were exchanged."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.numerics.estimate import Estimate
from pipeline.several.compare import Comparison, SpringRun, compare_springs
from pipeline.several.course import agreement
from pipeline.several.masses import hooke
from pipeline.track import Track
from tests import synthetic


def massless(runs: Sequence[SpringRun], mass_correlation: float = 0.0) -> Comparison:
    """Compare runs of a spring without mass."""
    return compare_springs(runs, spring_mass_kg=Estimate(0.0, 0.0, "kg"), mass_correlation=mass_correlation)


def oscillating(spring_kg: float, load_kg: float) -> float:
    """Return the mass that oscillates by x tan x = m_s/m, kg, found by bisection of its cotangent form."""
    low, high = 0.0, math.pi / 2.0
    for _ in range(60):
        x = 0.5 * (low + high)
        low, high = (x, high) if x * load_kg * math.sin(x) < spring_kg * math.cos(x) else (low, x)
    return spring_kg / x**2


def spring(name: str, k: float, mass_kg: float, relative: float = 1e-4) -> SpringRun:
    """Return a run of a spring with a mass."""
    omega = math.sqrt(k / mass_kg)
    return SpringRun(name, Estimate(omega, relative * omega), Estimate(mass_kg, 2e-5))


def test_common_clock_widens_the_mean_and_not_the_test() -> None:
    """A clock that all runs share shifts all constants alike."""
    runs = [spring("a", 14.0, 0.2), spring("b", 14.005, 0.22)]
    free, shared = massless(runs), massless([replace(run, u_clock=3e-5) for run in runs])
    assert shared.chi2 == pytest.approx(free.chi2, rel=1e-6)
    assert shared.largest_deviation == pytest.approx(free.largest_deviation, rel=1e-6)
    assert shared.spring_constant.u == pytest.approx(math.hypot(free.spring_constant.u, 6e-5 * 14.0), rel=1e-3)


def test_each_constant_is_as_uncertain_as_in_its_own_analysis() -> None:
    """A frequency that depends on the amplitude makes the constant uncertain alone and beside others."""
    t, spring_mass = synthetic.times(60.0), Estimate(0.01, 1e-4, "kg")
    scene = Scene(bob_mass_kg=Estimate(0.2, 2e-5, "kg"), spring_mass_kg=spring_mass)
    runs = [
        analyse(Track.from_arrays(t, synthetic.noisy(synthetic.Truth(gamma=0.02, kappa=kappa), t, 1e-4, 1)), scene)
        for kappa in (0.0, -10.0)
    ]
    springs = [SpringRun.of(str(number), run.derived) for number, run in enumerate(runs)]
    own = [run.estimates["spring_constant"].u for run in runs]
    assert own[1] > 3.0 * own[0]
    compared = compare_springs(springs, spring_mass_kg=spring_mass)
    assert [each.u for each in compared.each] == pytest.approx(own, rel=0.01)


def test_mean_is_that_of_generalised_least_squares() -> None:
    """Constant, its uncertainty and chi-square are those of scipy's fit of constant and spring, its mass an input."""
    runs = [spring("a", 14.0, 0.2, 1e-4), spring("b", 14.001, 0.21, 3e-4), spring("c", 13.999, 0.22, 2e-4)]
    found = compare_springs(runs, spring_mass_kg=Estimate(0.0099, 0.0006, "kg"))
    squared = np.array([run.angular_frequency.value**2 for run in runs])
    k = squared * np.array([oscillating(0.0099, run.mass_kg.value) for run in runs])
    relative = np.array([run.angular_frequency.u / run.angular_frequency.value for run in runs])
    own = np.hypot(k * 2 * relative, squared * 2e-5)

    def pulls(theta: np.ndarray) -> np.ndarray:
        each = squared * np.array([oscillating(theta[1] / 100, run.mass_kg.value) for run in runs])
        return np.append((each - theta[0]) / own, (theta[1] / 100 - 0.0099) / 0.0006)

    fit = least_squares(pulls, [14.0, 0.99], method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert found.spring_constant.value == pytest.approx(fit.x[0], rel=1e-8)
    assert found.spring_constant.u == pytest.approx(math.sqrt(np.linalg.inv(fit.jac.T @ fit.jac)[0, 0]), rel=1e-5)
    assert found.chi2 == pytest.approx(2.0 * fit.cost, rel=1e-6)
    assert [e.value for e in found.each] == [pytest.approx(x) for x in k]


def test_agreement_is_as_frequent_as_stated() -> None:
    """Of 1000 pairs of runs that are truly one spring's, 99.7 % agree."""
    rng = np.random.default_rng(1)
    agreed = 0
    for _ in range(1000):
        runs = []
        for name, mass in (("a", 0.2), ("b", 0.22)):
            true = spring(name, 14.0, mass)
            omega = Estimate(
                rng.normal(true.angular_frequency.value, true.angular_frequency.u), true.angular_frequency.u
            )
            runs.append(SpringRun(name, omega, Estimate(rng.normal(mass, 2e-5), 2e-5)))
        agreed += massless(runs).agree
    assert agreed >= 990


def test_one_balance_moves_all_masses_alike() -> None:
    """With fully correlated masses their error cancels in the test, by as much as the masses are alike."""
    runs = [replace(spring(name, 14.0, 0.2, 1e-5), mass_kg=Estimate(0.2, 1e-4)) for name in "ab"]
    free, tied = massless(runs), massless(runs, mass_correlation=1.0)
    assert free.each == tied.each
    assert tied.own_u[0] == pytest.approx(14.0 * 2e-5, rel=1e-6)
    assert tied.spring_constant.u > 1.3 * free.spring_constant.u
    with pytest.raises(ValueError, match="must lie in 0 to 1"):
        massless(runs, mass_correlation=1.5)


def hung(name: str, k: float, spring_kg: float, load_kg: float) -> SpringRun:
    """Return a run of a load on a spring with a mass."""
    omega = math.sqrt(k / oscillating(spring_kg, load_kg))
    return SpringRun(name, Estimate(omega, 2e-5 * omega), Estimate(load_kg, 2e-5))


def test_two_runs_solve_for_a_spring_that_nobody_weighed() -> None:
    """Two masses give constant and mass of the spring, and the message says that nothing tested them."""
    result = compare_springs([hung("a", 15.0, 0.027, 0.2), hung("b", 15.0, 0.027, 0.3)])
    assert result.agree
    assert result.dof == 0
    assert abs(result.spring_constant.value - 15.0) < 0.1 * result.spring_constant.u
    assert abs(result.spring_mass.value - 0.027) < 0.1 * result.spring_mass.u < 1e-4


def test_three_runs_test_what_they_solve_for() -> None:
    """A third mass leaves a degree of freedom, and a mistyped one is seen."""
    masses = {"a": 0.1, "b": 0.2, "c": 0.35}
    runs = [hung(name, 15.0, 0.05, m) for name, m in masses.items()]
    result = compare_springs(runs)
    assert (result.agree, result.dof, result.spring_mass_stated) == (True, 1, False)
    wrong = replace(runs[1], mass_kg=Estimate(0.206, 2e-5))
    result = compare_springs([runs[0], wrong, runs[2]])
    assert not result.agree


def test_scatter_within_and_between_is_what_was_put_in():
    """Over 400 benches of 5 runs the moments come back within some percent, and the mean within its uncertainty."""
    rng = np.random.default_rng(3)
    benches = np.repeat(np.arange(400), 5)
    values = 14.0 + 0.05 * rng.standard_normal(400)[benches] + 0.02 * rng.standard_normal(2000)
    found = agreement("k", "", [Estimate(float(x), 0.01, "N/m") for x in values], [str(b) for b in benches])
    assert found.within == pytest.approx(0.02, rel=0.05)
    assert found.between == pytest.approx(0.05, rel=0.1)
    assert abs(found.mean.value - 14.0) < 3.0 * found.mean.u
    assert found.mean.u == pytest.approx(0.05 / 20.0, rel=0.15)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_two_u_of_a_common_mean_cover_the_truth_of_few_benches(count: int) -> None:
    """Over 300 courses of benches that differ, 95.45 % intervals hold as often as that, within 3.3 deviations."""
    rng, held = np.random.default_rng(count), 0
    for _ in range(300):
        benches = np.repeat(np.arange(count), 3)
        values = 14.0 + 0.3 * rng.standard_normal(count)[benches] + 0.05 * rng.standard_normal(benches.size)
        found = agreement("k", "", [Estimate(float(x), 0.05, "N/m") for x in values], [str(b) for b in benches])
        held += abs(found.mean.value - 14.0) <= 2.0 * found.mean.u
    assert held >= 300 * (0.9545 - 3.3 * math.sqrt(0.9545 * 0.0455 / 300))


@pytest.mark.parametrize("count", [3, 4, 5])
def test_equal_constants_hardly_ever_disagree_by_hookes_law(count: int) -> None:
    """Of 500 sets of three to five masses E_n is above 1 in one in twenty at most, within 3.3 deviations."""
    rng, mass_kg, apart = np.random.default_rng(count), np.linspace(0.1, 0.3, count), 0
    for _ in range(500):
        position_m = 0.3 + rng.normal(9.81, 0.015) / 14.0 * mass_kg + 1e-3 * rng.standard_normal(count)
        apart += hooke(mass_kg, position_m).normalised_error(Estimate(rng.normal(14.0, 0.01), 0.01, "N/m")) > 1.0
    assert apart <= 500 * (0.0455 + 3.3 * math.sqrt(0.9545 * 0.0455 / 500))


@pytest.mark.parametrize("kind", ["a line", "an initial tension", "stretched too far"])
def test_hookes_law_takes_the_straight_part(kind: str) -> None:
    """A coiled spring is closed at first, one stretched too far becomes softer; k is that of the part between."""
    rng = np.random.default_rng(5)
    force = np.linspace(0.0, 2.0, 12)
    extension = {
        "a line": force / 14.0,
        "an initial tension": np.maximum(force - 0.6, 0.0) / 14.0,
        "stretched too far": np.maximum(force / 14.0, 1.4 / 14.0 + (force - 1.4) / 7.0),
    }[kind]
    found = hooke(force, 0.8 - extension + 3e-4 * rng.standard_normal(force.size), "N")
    assert abs(found.constant.value - 14.0) < 3.0 * found.constant.u < 0.6
    assert found.straight[0] == (kind != "an initial tension")
    assert found.straight[-1] == (kind != "stretched too far")
    assert found.straight.all() == (kind == "a line") == (not found.bend)
