"""The inverse of a small normal matrix, against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.normal_matrix import inverse_of


@pytest.mark.parametrize("p", [1, 2, 3])
def test_inverse_agrees_with_numpy_within_rounding_times_the_condition(p: int) -> None:
    """Columns of any units and nearly dependent ones: the error in natural units is a few roundings times cond."""
    rng = np.random.default_rng(p)
    for _ in range(300):
        columns = rng.standard_normal((6, p))
        if p > 1:
            columns[:, -1] = columns[:, 0] + 10.0 ** rng.uniform(-4, 0) * columns[:, -1]
        columns *= 10.0 ** rng.uniform(-6, 6, p)
        normal = columns.T @ columns
        scale = np.sqrt(normal.diagonal())
        natural = normal / np.outer(scale, scale)
        expected = np.linalg.inv(natural)
        error = np.abs(inverse_of(normal) * np.outer(scale, scale) - expected).max()
        assert error <= 1e-15 * np.linalg.cond(natural) * np.abs(expected).max()


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((1, 1)),
        np.array([[np.nan]]),
        np.ones((2, 2)),
        np.array([[1.0, 2.0], [2.0, 1.0]]),
        np.diag([1.0, 1.0, 0.0]),
        np.diag([1.0, np.nan, 1.0]),
    ],
)
def test_what_is_not_positive_definite_has_no_inverse(matrix: np.ndarray) -> None:
    """Zero, negative and NaN pivots give None and no warning."""
    assert inverse_of(matrix) is None
