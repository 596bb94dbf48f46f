"""How narrow intervals of the damping rate can be whoever states them: a bound, which none of the estimators enters.

``python -m tests.trials.test_law_bound`` prints what docs/explanation/accuracy.md says of friction alone.

A rule holds in 93 % of records under two drags, whose rates at the start differ by D. Let it state half an interval of
less than D/2 in half of the records of the first. In at least 0.5 - 0.07 of these the short interval covers the first
rate, and so misses the second. Between the two drags records differ by d standard deviations of their noise,
:math:`d^2 = \\sum_i (y_i - y_i')^2/\\sigma^2`; what has a probability p under one has at least
:math:`\\Phi(\\Phi^{-1}(p) - d)` under the other (Neyman and Pearson), which must not be above 0.07. So d is at least
:math:`\\Phi^{-1}(0.43) - \\Phi^{-1}(0.07) = 1.30`, and the median u at least :math:`D/(2 \\cdot 1.96)` for the largest
D of all drags that are nearer than that.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import ndtri

from tests.trials.test_law_coverage import AMPLITUDE_M, DRAGS, LEAST_95, NOISES_M, SECONDS, WIDEST, decayed, rate_of

F8 = NDArray[np.float64]
NEAREST = float(ndtri(0.5 - (1.0 - LEAST_95)) - ndtri(1.0 - LEAST_95))
SCALES = {"mu": 5e-4, "gamma": 0.01, "beta": 0.2}
OTHERS = {"linear and quadratic drag": ("gamma", "beta"), "drag with friction": ("mu", "gamma", "beta")}
STEPS = 100  # amplitudes of a record

pytestmark = pytest.mark.trials


def least_width(seconds: float, noise_m: float, others: str) -> float:
    """Return the least median u under friction over that of a fit of friction, if others are to cover as often."""
    true = DRAGS["friction"]
    at_start = rate_of(AMPLITUDE_M, true)

    def given(x: F8, names: tuple[str, ...]) -> tuple[F8, float]:
        """Amplitudes in deviations of the noise, and rate, of an amplitude and coefficients in their scales."""
        drag = {name: value * SCALES[name] for name, value in zip(names, x[1:].tolist(), strict=True)}
        # A cosine's mean square is half; each amplitude stands for the samples up to the next.
        weight = math.sqrt(0.5 * seconds * 100.0 / STEPS) / noise_m
        start_m = float(x[0]) * AMPLITUDE_M
        return weight * decayed(start_m, drag, seconds, STEPS / seconds), rate_of(start_m, drag)

    x0 = np.array([1.0, true["mu"] / SCALES["mu"]])
    middle, _ = given(x0, ("mu",))
    sides = [[given(x0 + sign * 1e-3 * e, ("mu",)) for sign in (1.0, -1.0)] for e in np.eye(2)]
    slopes = np.stack([(up[0] - down[0]) / 2e-3 for up, down in sides], axis=1)
    by = np.array([(up[1] - down[1]) / 2e-3 for up, down in sides])
    own = math.sqrt(by @ np.linalg.solve(slopes.T @ slopes, by))
    names, widest = OTHERS[others], 0.0

    def room(x: F8) -> float:
        return float(NEAREST**2 - np.sum((given(x, names)[0] - middle) ** 2))

    for sign in (1.0, -1.0):
        for start in (0.5, 1.0, 1.5):
            begin = np.array([1.0, *(start * (1.0 if name == "mu" else 0.5) for name in names)])
            found = minimize(
                lambda x, sign=sign: -sign * 1e3 * (given(x, names)[1] - at_start),
                begin,
                method="SLSQP",
                bounds=[(0.5, 2.0), *((0.0, 50.0) for _ in names)],
                constraints=[{"type": "ineq", "fun": room}],
            )
            if room(found.x) > -0.01:
                widest = max(widest, abs(given(found.x, names)[1] - at_start))
    return widest / (2.0 * float(ndtri(0.975)) * own)


def test_friction_alone_cannot_be_told_from_drag_within_the_limit() -> None:
    """Of 30 s at 2.39 mm no rule that holds under linear and quadratic drag has a u of 1.2 of friction's own."""
    assert least_width(30.0, 2.39e-3, "linear and quadratic drag") > WIDEST


def main() -> None:
    """Print the bounds."""
    for seconds in SECONDS:
        for noise_m in NOISES_M:
            widths = {others: least_width(seconds, noise_m, others) for others in OTHERS}
            listed = ", ".join(f"{width:.2f} beside {others}" for others, width in widths.items() if width > 0.0)
            print(f"friction alone, {seconds:g} s, {noise_m * 1e3:g} mm: u over the fit's at least {listed}")


if __name__ == "__main__":
    main()
