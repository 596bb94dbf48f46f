"""Sensitivity of a motion to each uncertain input: linear propagation of uncertainties along the trajectory.

Propagation is linear in the logarithm of the amplitude and in the phase, where it is valid much longer than in the
displacement. After a hundred periods an uncertain frequency can shift the phase by a radian, and then no derivative
describes the change of the displacement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.dynamics.problem import Problem
from pipeline.dynamics.strang import STRANG
from pipeline.track import F8

__all__ = ["C16", "STRETCH", "Sensitivity", "sensitivity", "solved"]

STRETCH = 2000  # number of steps in memory at a time
BENT = 0.1  # maximum nonlinearity, the mean of the two shifts of an input, relative to all sensitivities combined
BENT_LEAST = 1e-3  # negligible nonlinearity, relative to the maximum of the combined sensitivities

C16 = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Changes of the motion when each input changes by one standard uncertainty.

    Parameters
    ----------
    names : tuple of str
        Names of the inputs.
    t : (n,) float64, s
    middle : (n,) complex128, m
        :math:`y - iv/\\omega_0 = A e^{i\\theta}` for the scene's values.
    of_log : (k, n) complex128
        Change of :math:`\\ln A + i\\theta` with each input.
    holds : bool
        Whether the change is proportional to the input, up to one uncertainty in either direction and at all times.
    """

    names: tuple[str, ...]
    t: F8
    middle: C16
    of_log: C16
    holds: bool

    def displacement(self) -> F8:
        """Return the change of the displacement with each input (k, n) in m, linearised for small changes."""
        return np.asarray((self.middle * self.of_log).real)

    def phase_at_end(self) -> dict[str, float]:
        """Return the phase shift at the end in rad that each input's standard uncertainty causes."""
        return {name: float(abs(each[-1].imag)) for name, each in zip(self.names, self.of_log, strict=True)}


def solved(problems: Sequence[Problem], step_s: float, steps: int) -> Iterator[C16]:
    """Yield :math:`y - iv/\\omega_0` (members, n) in m of several problems for successive blocks of steps."""
    omegas = np.array([one.equation.angular_frequency_per_s for one in problems])[:, None]
    now = list(problems)
    for start in range(0, steps, STRETCH):
        runs = [STRANG.run(one, step_s, min(STRETCH, steps - start)) for one in now]
        rows = slice(0 if start == 0 else 1, None)  # a block begins with the last state of the previous block
        y, v = (np.array([getattr(run, name)[rows] for run in runs]) for name in ("y", "v"))
        yield y - 1j * v / omegas
        now = [Problem(run.problem.equation, run.y[-1], run.v[-1]) for run in runs]


def sensitivity(
    names: tuple[str, ...], middle: Problem, shifted: Sequence[Problem], step_s: float, steps: int
) -> Sensitivity:
    """Solve a motion with each input shifted both ways, and return its sensitivity to the inputs.

    Parameters
    ----------
    names : tuple of str
        Names of the inputs.
    middle : Problem
        The problem for the scene's values.
    shifted : sequence of Problem
        For each input two problems: with the input increased, then decreased, by its standard uncertainty.
    step_s : float
        Step, s.
    steps : int
        Number of steps.
    """
    parts = list(solved([middle, *shifted], step_s, steps))
    states = np.concatenate(parts, axis=1)
    still = states == 0.0
    ratio = np.where(still | still[0], 1.0, states / np.where(still[0], 1.0, states[0]))[1:]
    logs = np.log(np.abs(ratio)) + 1j * np.unwrap(np.angle(ratio), axis=1)
    ahead, behind = logs[0::2], logs[1::2]
    of_log = 0.5 * (ahead - behind)
    bends = np.sum(np.abs(0.5 * (ahead + behind)), axis=0)
    size = np.sqrt(np.sum(np.abs(of_log) ** 2, axis=0))
    holds = not still.any() and bool(np.all(bends <= BENT * size + BENT_LEAST * np.max(size, initial=0.0)))
    return Sensitivity(names, step_s * np.arange(steps + 1.0), states[0], of_log, holds)
