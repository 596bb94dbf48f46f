"""Digits that fitters reach on NIST's 54 starts, and what they cost: `python tests/reference/fitters.py`.

The table of docs/decisions/0012-scipy-least-squares.md. Model functions and starts are the same for all; options are
the defaults unless stated.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable

import lmfit
import numpy as np
from scipy.optimize import least_squares

from pipeline.numerics.least_squares import minimise
from tests.reference.nist_models import MODELS, DataSet, digits, read

Fitter = Callable[[DataSet, np.ndarray], tuple[np.ndarray, bool]]


def ours(data: DataSet, start: np.ndarray) -> tuple[np.ndarray, bool]:
    """Fit with pipeline.numerics.least_squares at the precision of reference values."""
    fit = minimise(data.residuals, start, precision=1e-8, steps=2000)
    return fit.values, fit.converged


def scipys(**options: object) -> Fitter:
    """Return scipy's least_squares with options."""

    def fit(data: DataSet, start: np.ndarray) -> tuple[np.ndarray, bool]:
        found = least_squares(data.residuals, start, **options)
        return found.x, bool(found.success)

    return fit


def lmfits(data: DataSet, start: np.ndarray) -> tuple[np.ndarray, bool]:
    """Fit with lmfit's minimize."""
    names = [f"b{i}" for i in range(start.size)]
    parameters = lmfit.create_params(**dict(zip(names, start.tolist(), strict=True)))
    found = lmfit.minimize(lambda p: data.residuals(np.array([p[name].value for name in names])), parameters)
    return np.array([found.params[name].value for name in names]), bool(found.success)


FITTERS: dict[str, Fitter] = {
    "pipeline.numerics.least_squares": ours,
    "scipy trf, 3-point, x_scale=jac": scipys(method="trf", jac="3-point", x_scale="jac", max_nfev=2000),
    "the same, tolerances 1e-15": scipys(
        method="trf", jac="3-point", x_scale="jac", max_nfev=2000, xtol=1e-15, ftol=1e-15, gtol=1e-15
    ),
    "scipy trf, default": scipys(),
    "scipy lm, default": scipys(method="lm"),
    "lmfit, default": lmfits,
}


def main() -> int:
    """Print how many starts reach six digits, how many misses say success, and the time of all 54."""
    print("| fitter | starts with 6 digits | misses that say success | raised | time of all 54 |")
    print("| --- | --- | --- | --- | --- |")
    for name, fitter in FITTERS.items():
        good = silent = raised = 0
        begin = time.perf_counter()
        for each in MODELS:
            data = read(each)
            for start in data.starts:
                try:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        values, converged = fitter(data, start)
                except (ValueError, FloatingPointError, np.linalg.LinAlgError):
                    raised += 1
                    continue
                enough = digits(values, data.certified) >= 6.0
                good += enough
                silent += converged and not enough
        spent = time.perf_counter() - begin
        print(f"| {name} | {good} ({good / 54:.0%}) | {silent} | {raised} | {spent:.2f} s |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
