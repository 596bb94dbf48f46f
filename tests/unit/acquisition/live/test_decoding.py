"""A chain of nodes is solved exactly: means, covariances and determinant are those of the full matrix."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.random_walk import Chain

F8 = np.ndarray


def made(nodes: int, sets: int, seed: int) -> tuple[Chain, F8, F8]:
    """Return a chain of random observations, its precision matrix and right-hand sides, node after node."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((nodes, 3, 2))
    values = rng.standard_normal((nodes, 3, sets))
    bond = rng.uniform(0.1, 50.0, nodes - 1)
    information, score = np.einsum("nri,nrj->ijn", rows, rows), np.einsum("nri,nrk->ikn", rows, values)
    precision = np.zeros((2 * nodes, 2 * nodes))
    for k in range(nodes):
        precision[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += rows[k].T @ rows[k]
    for k in range(nodes - 1):
        difference = np.zeros((2, 2 * nodes))
        difference[:, 2 * k : 2 * k + 2], difference[:, 2 * k + 2 : 2 * k + 4] = -np.eye(2), np.eye(2)
        precision += bond[k] * difference.T @ difference
    return Chain(information, score, bond), precision, score.transpose(2, 0, 1).reshape(2 * nodes, sets)


@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 5, 7, 8, 13, 64, 101])
def test_solution_is_that_of_the_full_matrix(nodes: int) -> None:
    """Every length, even and odd on every level of the reduction, gives what a dense solver gives."""
    chain, precision, right = made(nodes, 3, nodes)
    solved = chain.solve(covariance=True)
    dense = np.linalg.inv(precision)
    assert solved.covariance is not None
    np.testing.assert_allclose(
        solved.mean.transpose(2, 0, 1).reshape(2 * nodes, 3), dense @ right, rtol=1e-9, atol=1e-12
    )
    for k in range(nodes):
        block = dense[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
        np.testing.assert_allclose(solved.covariance[:, :, k], block, rtol=1e-9, atol=1e-12)
    assert solved.log_determinant == pytest.approx(np.linalg.slogdet(precision)[1], abs=1e-8)
