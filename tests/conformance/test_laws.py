"""Every damping law passes ``springmass.testing`` and obeys its equation; what is special about ours besides."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.damping.laws import LAWS, Drag, Law
from springmass.testing import check

# Rows of coefficients; a law takes those that its parameters name.
BENCHES = (
    {"A0": 0.051, "mu": 1.2e-4, "gamma": 0.0073, "beta": 0.235, "c": 0.07, "n": 1.5},
    {"A0": 0.002, "mu": 1e-5, "gamma": 0.05, "beta": 3.0, "c": 0.3, "n": 1.9},
    {"A0": 0.3, "mu": 1e-9, "gamma": 1e-9, "beta": 1e-9, "c": 1e-9, "n": 0.3},
    {"A0": 0.051, "mu": 1e-8, "gamma": 8.3e-6, "beta": 0.235, "c": 0.0146, "n": 1.0000001},  # near the series' borders
    {"A0": 0.051, "mu": 0.0, "gamma": 0.0, "beta": 0.0, "c": 0.0, "n": 1.0},
    {"A0": 0.051, "mu": 1e-4, "gamma": 0.001, "beta": 0.3, "c": 0.4, "n": 2.5},  # s is imaginary
    {"A0": 0.051, "mu": 1.0416666e-4, "gamma": 0.01, "beta": 0.24, "c": 2e-4, "n": 0.0},  # s is nearly 0
    *({"A0": 0.05, "mu": x * 0.01**2 / 0.96, "gamma": 0.01, "beta": 0.24, "c": 1e-3, "n": 1.0} for x in (1, 1 + 1e-13)),
    {"A0": 0.051, "mu": -1e-5, "gamma": -0.002, "beta": 0.1, "c": -0.001, "n": 1.2},  # a fit may step through these
)
# Benches at which friction or a small power stops the motion within the two minutes.
STOPPING = (
    {"A0": 0.05, "mu": 1e-3, "gamma": 0.0073, "beta": 0.235, "c": 0.004, "n": 0.5},
    {"A0": 0.05, "mu": 6e-4, "gamma": 0.01, "beta": 3.0, "c": 1e-3, "n": 0.0},
)
T = np.linspace(0.0, 120.0, 241)
# The power of the amplitude of each law that a free power contains.
WHOLE = {law.name: law.powers[0] if law.powers else 1 for law in LAWS.values() if isinstance(law, Drag)}


@pytest.fixture(params=sorted(LAWS))
def law(request: pytest.FixtureRequest) -> Law:
    """Return one law after the other."""
    return LAWS[request.param]


def theta_of(law: Law, bench: dict[str, float]) -> np.ndarray:
    """Return the law's parameters at a bench."""
    return np.array([bench[name] for name in law.parameters])


def amplitude_of(law: Law, t: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the law's amplitudes without their derivatives."""
    return law.curve(t, theta)[0]


def fall(law: Law, bench: dict[str, float]) -> Callable[[np.ndarray], np.ndarray]:
    """Return -dA/dt as the equation has it, written out again: the coefficients that the law names, else zero."""
    mu, gamma, beta, c = (bench[name] if name in law.parameters else 0.0 for name in ("mu", "gamma", "beta", "c"))
    return lambda a: mu + gamma * a + beta * a**2 + (c * np.abs(a) ** bench["n"] if c else 0.0)


def integrated(law: Law, bench: dict[str, float]) -> np.ndarray:
    """Return the amplitudes at T by an adaptive method of order 8, zero from where they reach zero."""
    rate = fall(law, bench)

    def stopped(_: float, a: np.ndarray) -> float:
        return float(a[0])

    stopped.terminal = True  # type: ignore[attr-defined]
    solved = solve_ivp(
        lambda _, a: -rate(a), (0.0, 120.0), [bench["A0"]], "DOP853", T, events=stopped, rtol=1e-13, atol=1e-15
    )
    result = np.zeros_like(T)
    result[: solved.y.shape[1]] = solved.y[0]
    return result


def test_it_keeps_the_rules_for_laws(law: Law) -> None:
    """Its curve, rate, derivatives, units and guess belong together, at every bench."""
    check(law, *BENCHES, *STOPPING)


@pytest.mark.parametrize("bench", [*BENCHES, *STOPPING])
def test_amplitude_solves_its_differential_equation(law: Law, bench: dict[str, float]) -> None:
    """The closed form is what an integrator makes of the equation, to 1e-10 of the first amplitude."""
    result = amplitude_of(law, T, theta_of(law, bench))
    np.testing.assert_allclose(result, integrated(law, bench), rtol=1e-10, atol=1e-10 * bench["A0"])


@pytest.mark.parametrize("bench", STOPPING)
def test_what_has_stopped_stays_at_rest(bench: dict[str, float]) -> None:
    """After friction has stopped the motion the amplitude stays zero and depends on nothing."""
    stopping = [law for law in LAWS.values() if {"mu", "n"} & set(law.parameters)]
    assert len(stopping) == 5
    for law in stopping:
        theta = theta_of(law, bench)
        amplitude = amplitude_of(law, np.linspace(0.0, 5000.0, 5001), theta)
        end = int(np.flatnonzero(amplitude == 0.0)[0])
        assert end < 200
        assert np.all(amplitude[:end] > 0)
        assert np.all(amplitude[end:] == 0)
        assert np.all(law.curve(np.linspace(end, 5000.0, 50), theta)[1] == 0)


def test_cases_are_laws_that_the_law_contains(law: Law) -> None:
    """Each special case is reached: with coefficients at zero, or the power at a whole number."""
    bench = BENCHES[0]
    for name in law.cases:
        case = LAWS[name]
        expected = amplitude_of(case, T, theta_of(case, bench))
        own = {n: bench[n] for n in case.parameters}
        power = {"c": sum(own[n] for n in case.parameters if n != "A0"), "n": WHOLE[name]}
        theta = theta_of(law, {**dict.fromkeys(bench, 0.0), **power, **own})
        np.testing.assert_allclose(amplitude_of(law, T, theta), expected, rtol=1e-12)


def test_long_falls_neither_overflow_nor_lose_digits() -> None:
    """At gamma t of 700 and more the fall is the exponential of the logarithm, and nothing overflows."""
    t = np.array([1.0, 100.0, 700.0, 740.0, 2000.0])
    theta = np.array([0.05, 1.0, 0.3])
    result = amplitude_of(LAWS["linear+quadratic"], t, theta)
    np.testing.assert_allclose(result[:4], 0.05 * np.exp(-t[:4]) / (1.0 + 0.3 * 0.05 * -np.expm1(-t[:4])), rtol=1e-12)
    assert result[4] == 0.0
    assert np.all(np.isfinite(LAWS["linear+quadratic"].curve(t, theta)[1]))


def test_growing_amplitudes_end_at_a_pole() -> None:
    """Negative coefficients, through which a fit may step, grow to a pole and are infinite beyond it."""
    t = np.linspace(0.0, 300.0, 301)
    for theta in ([0.05, -0.001, -0.5], [0.05, 0.001, -0.5]):
        result = amplitude_of(LAWS["linear+quadratic"], t, np.array(theta))
        assert np.all(result > 0)
        assert np.isinf(result[-1])
    assert np.isinf(amplitude_of(LAWS["quadratic+friction"], t, np.array([0.05, -0.5, -1e-4]))[-1])
    assert np.isinf(amplitude_of(LAWS["power"], t, np.array([0.05, -0.5, 2.0]))[-1])
