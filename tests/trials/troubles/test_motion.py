"""The trials' own integrator follows what can be solved by hand, and their verdicts what can be counted by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tests.trials.troubles.motion import Bob, swing

pytestmark = pytest.mark.trials


def test_linear_drag_follows_the_solution_by_hand() -> None:
    """A linearly damped bob lies within two parts in ten thousand of the solution by hand, for forty periods."""
    omega, gamma, phase = 8.3, 0.02, 0.7
    damped = math.sqrt(omega**2 - gamma**2)
    # The start of swing is displacement and velocity of an undamped bob; of a damped one they give another amplitude.
    x, v = 0.05 * math.cos(phase), -0.05 * omega * math.sin(phase)
    sine = (v + gamma * x) / damped
    t = np.linspace(0.0, 30.0, 3001)
    motion = swing(Bob(omega=omega, amplitude=0.05, phase=phase, gamma=gamma), 30.0, start=0.0)
    by_hand = np.exp(-gamma * t) * (x * np.cos(damped * t) + sine * np.sin(damped * t))
    assert motion.position(t) == pytest.approx(by_hand, abs=2e-4 * 0.05)
    assert motion.period(0.0, 30.0) == pytest.approx(2.0 * math.pi / damped, rel=1e-6)
    assert motion.amplitude(10.0) == pytest.approx(math.exp(-gamma * 10.0) * math.hypot(x, sine), rel=1e-6)
    assert motion.rate(10.0) == pytest.approx(gamma, rel=1e-4)


@pytest.mark.parametrize(
    ("bob", "rate"),
    [
        (Bob(beta=0.4), lambda a: 0.4 * a),
        (Bob(gamma=0.01, beta=0.2), lambda a: 0.01 + 0.2 * a),
        (Bob(c=0.07, n=1.5), lambda a: 0.07 * a**0.5),
        (Bob(mu=3e-4), lambda a: 3e-4 / a),
    ],
    ids=["quadratic", "mixed", "power", "friction"],
)
def test_the_amplitude_falls_as_the_law_says(bob: Bob, rate: Callable[[float], float]) -> None:
    """The rate read off the turning points is the averaged law's at the amplitude there, within a thousandth."""
    motion = swing(bob, 30.0)
    for t in (0.0, 15.0, 29.0):
        assert motion.rate(t) == pytest.approx(rate(motion.amplitude(t)), rel=1e-3)
