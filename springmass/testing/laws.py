"""The rules for a damping law, at parameters (p,) and times (n,) in s."""

from collections.abc import Mapping
from itertools import product

import numpy as np

from pipeline.damping.law_fit import fit_law
from pipeline.damping.laws import FunctionLaw, Law, find_law, in_units
from pipeline.numerics.least_squares import CENTRAL_STEP, central_differences
from pipeline.track import F8
from pipeline.units import Unit
from springmass.testing.demands import demand

_SIZES = (0.0, *(10.0**power for power in (-300, -200, -100, -20, -12, -8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3)))


def case_of(law: Law, example: Mapping[str, float]) -> tuple[Law, F8, F8]:
    """Return a law, its parameters, and times of two minutes or until the amplitude has fallen far."""
    missing = ", ".join(name for name in law.parameters if name not in example)
    demand(not missing, f"law {law.name}: give an example with a number for {missing}")
    theta = np.array([example[name] for name in law.parameters])
    fall = abs(float(law.rate(theta[:1], theta)[0]))
    return law, theta, np.linspace(0.0, min(120.0, 10.0 * theta[0] / fall) if fall else 120.0, 241)


def _tolerance(law: Law) -> float:
    """Return the part of the amplitude that rounding may take; more where a function is differentiated by steps."""
    return 1e-5 if isinstance(law, FunctionLaw) else 1e-9


def starts_at_a0(law: Law, theta: F8, t: F8) -> None:
    """A law has a name of its own and A0 in metres before its coefficients; at t = 0 the amplitude is A0."""
    find_law(law)
    for name in law.cases:
        find_law(name)
    demand(next(iter(law.parameters.items())) == ("A0", Unit(1)), 'begin parameters with "A0": Unit(1)')
    amplitude, by = law.curve(t, theta)
    shapes = (amplitude.shape, by.shape, law.rate(amplitude, theta).shape)
    expected = (t.shape, (t.size, theta.size), t.shape)
    demand(shapes == expected, f"return arrays of the shapes {expected} from curve and rate, got {shapes}")
    begins = np.isclose(amplitude[0], theta[0], rtol=1e-14) and np.allclose(by[0], np.eye(theta.size)[0], atol=1e-9)
    demand(begins, f"begin at A0 = {theta[0]:g}, whatever the coefficients, got {amplitude[0]:g}")
    if (theta >= 0.0).all():
        late = law.curve(np.linspace(0.0, 1e4, 2001), theta)[0]
        falls = (late >= 0.0).all() and (np.diff(late) <= 1e-15 * theta[0]).all()
        demand(falls, "let the amplitude neither grow nor be negative for positive coefficients")


def falls_by_its_rate(law: Law, theta: F8, t: F8) -> None:
    """The amplitude is what an integrator makes of the rate, which depends on the amplitude alone."""
    from scipy.integrate import solve_ivp

    def stopped(_: float, a: F8) -> float:
        return float(a[0])

    def rate(_: float, a: F8) -> F8:
        return law.rate(a, theta)

    stopped.terminal = True  # type: ignore[attr-defined]  # an event of solve_ivp
    solved = solve_ivp(rate, t[[0, -1]], theta[:1], "DOP853", t, events=stopped, rtol=1e-13, atol=1e-15).y[0]
    off = float(np.max(np.abs(law.curve(t, theta)[0] - np.append(solved, np.zeros(t.size - solved.size))))) / theta[0]
    demand(off <= _tolerance(law), f"let the amplitude fall by dA/dt = rate(A); it differs by {off:.1g} of A0")
    a, doubled = np.linspace(0.1, 1.0, 5) * theta[0], np.append(2.0 * theta[0], theta[1:])
    same = np.allclose(law.rate(a, doubled), law.rate(a, theta), rtol=1e-12)
    demand(same, "let the rate depend on the amplitude alone, not on A0")


def jacobian_is_the_derivative(law: Law, theta: F8, t: F8) -> None:
    """Each column of the Jacobian is the derivative of the amplitude, but for the moment of a stop."""
    amplitude, by = law.curve(t, theta)
    plain = (amplitude > 0.02 * theta[0]) | (law.curve(t - t[-1] / 24.0, theta)[0] <= 0.0)
    expected = central_differences(lambda at: law.curve(t, at)[0], theta)
    rounding = 1e-15 * theta[0] / (CENTRAL_STEP * np.maximum(np.abs(theta), CENTRAL_STEP))
    fine = (np.abs(by - expected)[plain] <= 1e-6 * np.abs(expected).max(axis=0) + rounding).all(axis=0)
    for name, correct in zip(law.parameters, fine.tolist(), strict=True):
        demand(correct, f"return the derivative of the amplitude by {name} from curve")


def units_do_not_matter(law: Law, theta: F8, t: F8) -> None:
    """Parameters in other units, by their exponents, give the same fall and rate in those units."""
    a = np.array([0.02, 0.4, 1.0]) * theta[0]
    for length_m, time_s in ((1e-3, 60.0), (1e3, 1.0)):
        scaled = in_units(law, theta, length_m=length_m, time_s=time_s)
        fall = law.curve(t / time_s, scaled)[0] * length_m
        rate = law.rate(a / length_m, scaled) * length_m / time_s
        same = np.allclose(fall, law.curve(t, theta)[0], rtol=0, atol=_tolerance(law) * theta[0])
        same = same and np.allclose(rate, law.rate(a, theta), rtol=1e3 * _tolerance(law))
        demand(same, "give each parameter the exponents of its Unit; in other units the law falls differently")


def guess_leads_to_the_truth(law: Law, theta: F8, t: F8) -> None:
    """From the law's guess a fit reaches what made clean points in any unit of length; odd points give a guess too."""
    t = t[law.curve(t, theta)[0] > 0.1 * theta[0]]
    few = t[np.linspace(0, t.size - 1, 8).astype(int)]
    for length_m, points in product((1.0, 1e6, 1e-5), (t, few)):
        truth = in_units(law, theta, length_m=length_m)
        y = law.curve(points, truth)[0]
        fitted = fit_law(law, points, y, np.full(y.size, 1e-7 * truth[0])).values
        same = np.allclose(law.curve(points, fitted)[0], y, rtol=0, atol=10.0 * _tolerance(law) * truth[0])
        demand(same, f"guess values from which a fit reaches {truth}; it ended at {fitted}")
    # A law made of a function is not asked about fewer points than it has parameters.
    fewest = theta.size if isinstance(law, FunctionLaw) else 1
    noise = np.abs(np.random.default_rng(5).normal(0.0, 1e-3, 30))
    for y in (noise, np.full(30, 0.05), np.full(fewest, 0.05)):
        start = law.guess(0.75 * np.arange(float(y.size)), y)
        fine = start.shape == theta.shape and np.isfinite(start).all()
        demand(fine, f"guess {theta.size} finite numbers for {y.size} points, even of noise, got {start}")


def every_size_is_finite(law: Law, theta: F8, t: F8) -> None:
    """All is finite for each coefficient from 0 to 1e3, and a vanishing one gives the amplitude of one that is 0."""
    for k, others in product(range(1, theta.size), (1.0, 0.0)):
        zero = theta * np.append(1.0, np.full(theta.size - 1, others))
        zero[k] = 0.0
        for size in _SIZES:
            changed = zero + size * np.eye(zero.size)[k]
            amplitude, by = law.curve(t, changed)
            parts = (amplitude, by, law.rate(amplitude, changed))
            what = f"{list(law.parameters)[k]} = {size:g}"
            demand(all(np.isfinite(part).all() for part in parts), f"return finite numbers for {what}")
            same = np.allclose(amplitude, law.curve(t, zero)[0], rtol=0, atol=_tolerance(law) * theta[0])
            demand(same or size > 1e-20, f"let {what} give what 0 gives; use expm1 or a series where it divides")


RULES = (
    starts_at_a0, falls_by_its_rate, jacobian_is_the_derivative, units_do_not_matter, guess_leads_to_the_truth,
    every_size_is_finite,
)  # fmt: skip
