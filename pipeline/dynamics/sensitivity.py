"""How each uncertain input moves a motion: linear propagation of uncertainties along the trajectory.

Linear in the logarithm of the amplitude and in the phase, where it holds far longer than in the displacement: after a
hundred periods an uncertain frequency turns the phase by a radian, and the displacement by no derivative.
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

STRETCH = 2000  # steps held in memory
BENT = 0.1  # of all sensitivities together: as much may the mean of two shifts differ from none
BENT_LEAST = 1e-3  # of the largest: what differs by less is of no account

C16 = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Changes of the motion with each input, by one standard uncertainty of it.

    Parameters
    ----------
    names : tuple of str
        The inputs.
    t : (n,) float64, s
    middle : (n,) complex128, m
        :math:`y - iv/\\omega_0 = A e^{i\\theta}` of the scene's values.
    of_log : (k, n) complex128
        Change of :math:`\\ln A + i\\theta` with each input.
    holds : bool
        Whether it is a change in proportion, up to one uncertainty either way and at all times.
    """

    names: tuple[str, ...]
    t: F8
    middle: C16
    of_log: C16
    holds: bool

    def displacement(self) -> F8:
        """Return the change of the displacement with each input (k, n), m: linear, for small changes."""
        return np.asarray((self.middle * self.of_log).real)

    def phase_at_end(self) -> dict[str, float]:
        """Return by how many radians each input's uncertainty turns the phase at the end."""
        return {name: float(abs(each[-1].imag)) for name, each in zip(self.names, self.of_log, strict=True)}


def solved(problems: Sequence[Problem], step_s: float, steps: int) -> Iterator[C16]:
    """Yield :math:`y - iv/\\omega_0` (members, n), m, of several problems, a stretch of their steps at a time."""
    omegas = np.array([one.equation.angular_frequency_per_s for one in problems])[:, None]
    now = list(problems)
    for start in range(0, steps, STRETCH):
        runs = [STRANG.run(one, step_s, min(STRETCH, steps - start)) for one in now]
        rows = slice(0 if start == 0 else 1, None)  # a stretch begins where the last one ended
        y, v = (np.array([getattr(run, name)[rows] for run in runs]) for name in ("y", "v"))
        yield y - 1j * v / omegas
        now = [Problem(run.problem.equation, run.y[-1], run.v[-1]) for run in runs]


def sensitivity(
    names: tuple[str, ...], middle: Problem, shifted: Sequence[Problem], step_s: float, steps: int
) -> Sensitivity:
    """Solve a motion and its neighbours.

    Parameters
    ----------
    names : tuple of str
        The inputs.
    middle : Problem
        Of the scene's values.
    shifted : sequence of Problem
        For each input one with it larger, then one with it smaller, by its standard uncertainty.
    step_s : float
    steps : int
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
