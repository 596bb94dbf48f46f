"""Simulate and evaluate one record; the checks count the outcomes over many seeds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.analyse import analyse
from pipeline.errors import PipelineError
from pipeline.options import options_for
from pipeline.track import Track
from tests import synthetic

__all__ = ["QUANTITIES", "Case", "Outcome", "bounds", "evaluate"]

QUANTITIES = ("frequency", "amplitude", "phase", "gamma")


@dataclass(frozen=True, kw_only=True)
class Case:
    """The properties of a simulated record.

    Parameters
    ----------
    seconds, rate_hz, noise_m : float
    truth : dict
        Arguments of ``synthetic.Truth``; the phase is drawn at random from the seed.
    echoes : float
        Share of the samples that are false echoes.
    clustered : bool
        Whether false echoes come in runs of 3 to 18 samples around the turning points, displaced by some millimetres
        and moving with the bob. Otherwise they are single and lie anywhere up to 2 m.
    origin_s : float
        Time of the first sample, s.
    """

    seconds: float = 120.0
    rate_hz: float = 100.0
    noise_m: float = 3e-4
    truth: dict[str, float] = field(default_factory=lambda: {"gamma": 0.01463})
    echoes: float = 0.0
    clustered: bool = False
    origin_s: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """The result of analysing one record.

    Parameters
    ----------
    why : str
        Reason why nothing was estimated; empty if there is an estimate.
    error, u : (4,) float64
        Errors and uncertainties of frequency (Hz), amplitude (m), phase (rad) and gamma (1/s). Amplitude and gamma are
        those of the exponential law, and NaN if it was not fitted. The uncertainties exclude that of the clock, because
        simulated clocks are exact.
    selected : str
        Name of the selected law.
    admissible, rejected : tuple of str
        Names of laws.
    """

    why: str
    error: np.ndarray
    u: np.ndarray
    selected: str = ""
    admissible: tuple[str, ...] = ()
    rejected: tuple[str, ...] = ()


def evaluate(job: tuple[Case, str, int]) -> Outcome:
    """Simulate a record from its seed and analyse it at an accuracy tier."""
    case, tier, seed = job
    truth, track = record(case, seed)
    nothing = np.full(4, np.nan)
    try:
        analysis = analyse(track, options=options_for(tier))
    except PipelineError as error:
        return Outcome(str(error), nothing, nothing)
    except Exception as error:  # count a defect like a refusal, so that the other records are still measured
        return Outcome(f"{type(error).__name__}: {error}", nothing, nothing)
    if (motion := analysis.oscillation) is None:
        return Outcome(analysis.why, nothing, nothing)
    # Phase and amplitude refer to the first used sample, which is later if the first samples are false echoes.
    start = np.array([motion.damping.t0 - case.origin_s])
    true_phase, true_amplitude = float(truth.phase_at(start)[0]), float(truth.amplitude_at(start)[0])
    period, phase = analysis.derived.statistical["period"], analysis.estimates["phase"]
    pairs = {
        "frequency": (1 / period.value - 1 / truth.period, period.u / period.value**2),
        "phase": (math.remainder(phase.value - true_phase, 2 * math.pi), phase.u),
    }
    linear = motion.damping.fits.get("linear")
    if linear is not None:
        first, gamma = linear.joint["A0"], linear.joint["gamma"]
        pairs["amplitude"] = (first.value - true_amplitude, first.u)
        pairs["gamma"] = (gamma.value - truth.gamma, gamma.u)
    error, u = (np.array([pairs.get(name, (np.nan, np.nan))[i] for name in QUANTITIES]) for i in (0, 1))
    damping = motion.damping
    rejected = tuple(name for name, fit in damping.fits.items() if fit.rejected)
    return Outcome("", error, u, damping.selected, tuple(damping.admissible), rejected)


def record(case: Case, seed: int) -> tuple[Any, Track]:
    """Return the true motion of a seed, and its track."""
    rng = np.random.default_rng((seed, 1))
    truth = synthetic.Truth(**{"phase": float(rng.uniform(-math.pi, math.pi)), **case.truth})
    t = synthetic.times(case.seconds, case.rate_hz)
    y = synthetic.noisy(truth, t, case.noise_m, seed)
    if case.clustered:
        _clusters(truth, t, y, case.echoes, rng)
    else:
        false = rng.random(t.size) < case.echoes
        y[false] = rng.uniform(0.0, 2.0, np.count_nonzero(false))
    return truth, Track.from_arrays(t + case.origin_s, y, rate_hz=case.rate_hz, kind="simulated")


def _clusters(truth: Any, t: np.ndarray, y: np.ndarray, share: float, rng: np.random.Generator) -> None:
    """Shift runs of samples around turning points by 3 to 12 mm, until the share is reached."""
    moves = np.diff(truth.position(t))
    turns = np.flatnonzero(moves[:-1] * moves[1:] <= 0) + 1
    done = 0
    for turn in rng.permutation(turns):
        if done >= share * t.size:
            break
        length = int(rng.integers(3, 19))
        first = max(int(turn) - int(rng.integers(0, length)), 0)
        y[first : first + length] += rng.choice([-1.0, 1.0]) * rng.uniform(0.003, 0.012)
        done += length


def bounds(case: Case) -> np.ndarray:
    """Return the Cramér-Rao bounds of the quantities (4,), averaged over the phase, without the false echoes."""
    t = synthetic.times(case.seconds, case.rate_hz)
    found = []
    for phase in np.linspace(-math.pi, math.pi, 9)[:-1]:
        truth = synthetic.Truth(**{**case.truth, "phase": float(phase)})
        each = synthetic.fisher_bounds(truth, t, case.noise_m)
        found.append([each["omega"] / (2 * math.pi), each["amplitude"], each["phase"], each["gamma"]])
    return np.sqrt(np.mean(np.square(found), axis=0) / (1.0 - case.echoes))
