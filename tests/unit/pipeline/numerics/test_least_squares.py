"""The general fitter: closed forms, units that do not matter, and failures that are told."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.numerics.least_squares import Fit, minimise

T = np.linspace(0.0, 120.0, 159)


def exponential(seed: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Return amplitudes of a decay and the truth."""
    truth = np.array([0.05, 0.01463])
    return truth[0] * np.exp(-truth[1] * T) + sigma * np.random.default_rng(seed).standard_normal(T.size), truth


def fit_decay(y: np.ndarray, sigma: float, start: tuple[float, float], **options: float) -> Fit:
    """Fit a decay with its derivatives in closed form."""

    def jacobian(b: np.ndarray) -> np.ndarray:
        decay = np.exp(-b[1] * T)
        return np.stack([decay, -b[0] * T * decay], axis=1) / sigma

    return minimise(lambda b: (b[0] * np.exp(-b[1] * T) - y) / sigma, start, jacobian, **options)


def test_a_linear_problem_is_solved_by_the_normal_equations() -> None:
    """A straight line: values and covariance are those of the closed form."""
    rng = np.random.default_rng(1)
    x, y = np.arange(20.0), rng.standard_normal(20)
    design = np.stack([np.ones(20), x], axis=1)
    fit = minimise(lambda b: design @ b - y, [0.0, 0.0], precision=1e-9)
    inverse = np.linalg.inv(design.T @ design)
    assert fit.converged
    assert fit.values == pytest.approx(inverse @ design.T @ y, rel=1e-8)
    assert fit.covariance == pytest.approx(inverse, rel=1e-7)
    assert fit.cost == pytest.approx(float(np.sum((design @ fit.values - y) ** 2)))


@pytest.mark.parametrize("seed", range(2))
def test_its_minimum_and_covariance_are_those_of_scipys_own_call(seed: int) -> None:
    """A fit with derivatives in closed form ends where scipy's differences end."""
    y, _ = exponential(seed, 1e-4)
    ours = fit_decay(y, 1e-4, (0.04, 0.01), precision=1e-8)
    other = least_squares(lambda b: (b[0] * np.exp(-b[1] * T) - y) / 1e-4, [0.04, 0.01], method="lm", xtol=1e-14)
    assert ours.converged
    assert ours.values == pytest.approx(other.x, rel=1e-7)
    assert ours.covariance == pytest.approx(np.linalg.inv(other.jac.T @ other.jac), rel=1e-4)


@pytest.mark.parametrize("scale", [2.0**-40, 2.0**-10, 2.0**30])
def test_no_step_hangs_on_the_unit(scale: float) -> None:
    """In units that differ by a power of two, so that nothing rounds otherwise, every bit is the same."""
    y, _ = exponential(2, 1e-4)
    plain = fit_decay(y, 1e-4, (0.04, 0.01))
    other = fit_decay(y * scale, 1e-4 * scale, (0.04 * scale, 0.01))
    assert other.steps == plain.steps
    assert (other.values / [scale, 1.0]).tolist() == plain.values.tolist()
    assert (other.covariance / np.outer([scale, 1], [scale, 1])).tolist() == plain.covariance.tolist()


def test_perfect_data_are_fitted_to_rounding() -> None:
    """Without noise there is no uncertainty to stop at; rounding ends the fit, and it counts as converged."""
    y, truth = exponential(0, 0.0)
    fit = fit_decay(y, 1.0, (0.04, 0.01), precision=1e-8)
    assert fit.converged
    assert fit.values == pytest.approx(truth, rel=1e-12)


def test_as_many_residuals_as_parameters_are_solved() -> None:
    """Two equations, two unknowns: the root of the system, and no degree of freedom is needed."""
    fit = minimise(lambda b: np.array([b[0] * b[1] - 6.0, b[0] - b[1] - 1.0]), [2.5, 1.5])
    assert fit.converged
    assert fit.values == pytest.approx([3.0, 2.0], rel=1e-9)


def test_a_parameter_without_influence_is_no_minimum() -> None:
    """On a plateau the fit says which parameter the data do not determine, and gives no covariance."""
    fit = minimise(lambda b: b[0] + 0.0 * b[1] - np.arange(5.0), [1.0, 2.0])
    assert not fit.converged
    assert np.all(np.isnan(fit.covariance))


def test_parameters_that_are_one_are_told() -> None:
    """A sum of two parameters can be fitted, the two cannot."""
    fit = minimise(lambda b: (b[0] + b[1]) * np.arange(5.0) - np.arange(5.0) ** 2, [1.0, 2.0])
    assert not fit.converged


def test_running_out_of_steps_is_told() -> None:
    """Three steps are too few for a start so far away."""
    y, _ = exponential(1, 1e-4)
    fit = fit_decay(y, 1e-4, (1.0, 0.2), steps=3)
    assert not fit.converged
    assert fit.steps == 3


def test_a_start_without_a_value_is_told() -> None:
    """Residuals that are no numbers at the start end the fit there."""
    fit = minimise(lambda b: np.log(b[0]) * np.ones(3), [-1.0])
    assert not fit.converged


def test_steps_into_the_void_are_not_taken() -> None:
    """Where a step leaves the model's domain a shorter one is tried."""
    x = np.linspace(0.1, 2.0, 30)
    y = np.sqrt(x + 0.05)
    fit = minimise(lambda b: b[1] * np.sqrt(x - b[0]) - y, [0.09, 3.0], precision=1e-8)
    assert fit.converged
    assert fit.values == pytest.approx([-0.05, 1.0], rel=1e-8)


def test_fewer_residuals_than_parameters_are_refused() -> None:
    """Two parameters from one number: the caller gets an error."""
    with pytest.raises(ValueError, match="got 1 for 2"):
        minimise(lambda b: b[:1], [1.0, 2.0])
