"""Mixed drag is told where a record demands two terms, and nowhere else; a misfit widens what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from pipeline.damping.mixture import MixedDrag, Params, find_mixed
from pipeline.damping.select import Damping, fit_damping
from pipeline.windows.demodulate import Demodulated

Windows = Callable[..., Demodulated]
T = 0.4 + 0.757 * np.arange(158)  # two minutes
U_M = 3e-5


def fitted(windows: Windows, amplitude: np.ndarray, seed: int = 1) -> Damping:
    """Return the laws' fits to amplitudes with independent normal errors."""
    noisy = amplitude + np.random.default_rng(seed).normal(0.0, U_M, amplitude.size)
    return fit_damping(windows(T, noisy, u=(U_M, 1e-4, 1e-5)), 0.0)


def found(windows: Windows, amplitude: np.ndarray) -> MixedDrag:
    """Return the mixture that there is."""
    mixed = find_mixed(fitted(windows, amplitude))
    assert mixed is not None
    return mixed


@pytest.mark.parametrize(
    "terms",
    [
        {"gamma": 0.0073, "beta": 0.235},
        {"gamma": 0.0073, "mu": 1.5e-4},
        {"beta": 0.3, "mu": 1e-4},
        {"gamma": 0.006, "beta": 0.3, "mu": 6e-5},
    ],
)
def test_terms_of_the_truth_are_told(synthetic: ModuleType, windows: Windows, terms: dict[str, float]) -> None:
    """Its law holds the true terms, each within four uncertainties, and every lone term is far worse."""
    mixed = found(windows, synthetic.Truth(**terms).amplitude_at(T))
    assert set(mixed.fit.law.parameters) == {"A0", *terms}
    for name, true in terms.items():
        assert abs(mixed.fit.joint[name].value - true) < 4.0 * mixed.fit.joint[name].u
    assert set(mixed.against) == {"linear", "quadratic", "friction"}
    assert min(mixed.against.values()) > 10.0


@pytest.mark.parametrize("term", [{"gamma": 0.01463}, {"beta": 0.45}, {"mu": 2e-4}, {}])
def test_one_term_is_no_mixture(synthetic: ModuleType, windows: Windows, term: dict[str, float]) -> None:
    """No lone law and no undamped motion passes for a mixture, in twenty runs of each."""
    amplitude = synthetic.Truth(**term).amplitude_at(T)
    assert not any(find_mixed(fitted(windows, amplitude, seed)) for seed in range(20))


def test_short_records_show_none(synthetic: ModuleType, windows: Windows) -> None:
    """Twenty seconds of both drags could be one drag with a little of another: nothing is said."""
    short = T < 20.0
    amplitude = synthetic.Truth(gamma=0.0073, beta=0.235).amplitude_at(T[short])
    assert find_mixed(fit_damping(windows(T[short], amplitude, u=(U_M, 1e-4, 1e-5)), 0.0)) is None


def test_a_misfit_widens_but_does_not_hide(synthetic: ModuleType, windows: Windows) -> None:
    """Of a power of 1.54 both drags are rejected, found together all the same, with intervals that hold the misfit."""
    amplitude = synthetic.Truth(amplitude=0.07, c=0.18, n=1.54).amplitude_at(T)
    mixed = found(windows, amplitude)
    fit = mixed.fit
    assert fit.name == "linear+quadratic"
    assert fit.rejected
    assert fit.widening > 30.0
    # The rate's slope against amplitude, by hand from the truth, is no constant beta.
    slopes = 0.18 * 0.54 * amplitude[[10, -10]] ** -0.46
    formal = fit.joint["beta"].u / np.sqrt(fit.widening)
    assert slopes[1] - slopes[0] > 30.0 * formal
    # The first amplitude, too, is off by less than its widened uncertainty says and by more than the formal one.
    error = abs(fit.joint["A0"].value - 0.07)
    assert 5.0 * fit.joint["A0"].u / np.sqrt(fit.widening) < error < 3.0 * fit.joint["A0"].u


def test_evidence_is_an_option(synthetic: ModuleType, windows: Windows) -> None:
    """More evidence than there is may be asked for."""
    damping = fitted(windows, synthetic.Truth(gamma=0.0073, beta=0.235).amplitude_at(T))
    assert find_mixed(damping, Params(evidence=1e9)) is None
