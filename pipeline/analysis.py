"""The result of an analysis: one run with its estimates, effects and findings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pipeline.bench.scene import Scene
from pipeline.checks.echoes import count_quality
from pipeline.errors import AnalysisError
from pipeline.findings.finding import Finding
from pipeline.motion.at_rest import Rest
from pipeline.motion.fitted import Fitted
from pipeline.motion.relaxation import Relaxation
from pipeline.motion.two_modes import TwoModes
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.results.curves import Smoothed, kinematics
from pipeline.results.derive import Derived
from pipeline.results.effects import Effect
from pipeline.samples.condition import Samples
from pipeline.track import U8, UNUSABLE, Track
from pipeline.windows.cycles import Cycles


@dataclass(frozen=True, slots=True, eq=False)
class Oscillation(Fitted):
    """An oscillation, strongly damped or not: its fit and the results derived from it."""

    cycles: Cycles
    derived: Derived

    @classmethod
    def of(cls, fitted: Fitted, cycles: Cycles, derived: Derived) -> Oscillation:
        """Return a fit with its results."""
        return cls(**{each.name: getattr(fitted, each.name) for each in fields(fitted)}, cycles=cycles, derived=derived)


Motion = Oscillation | Relaxation | TwoModes | Rest


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The analysis of one run.

    Every kind of motion has results with budgets; only an oscillation has laws. For a relaxation they contain the
    relaxation rates, for two overlapping modes their periods and amplitudes, and for a bob at rest only the offset and
    the noise.
    """

    track: Track
    scene: Scene
    options: Options
    samples: Samples
    motion: Motion
    effects: tuple[Effect, ...]
    findings: tuple[Finding, ...]  # the most severe first
    derived: Derived  # estimates and their budgets

    @property
    def flags(self) -> U8:
        """The final flags of all samples, (n,) uint8."""
        return self.motion.flags

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The estimates by names in :data:`pipeline.quantities.QUANTITIES`."""
        return self.derived.estimates

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: True for samples without any flag that excludes them."""
        return np.asarray((self.flags & UNUSABLE) == 0, np.bool_)

    @property
    def quality(self) -> dict[str, int]:
        """The number of samples with each flag, and the number of samples used."""
        return count_quality(self.flags)

    @one_thread
    def smoothed(self) -> Smoothed:
        """Return position, velocity and acceleration at every sample from the fit, with their uncertainties.

        >>> import numpy as np
        >>> from pipeline.analyse import analyse
        >>> t = np.arange(1000) / 100
        >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 3e-4 * np.random.default_rng(1).standard_normal(1000)
        >>> motion = analyse(Track.from_arrays(t, y)).smoothed()
        >>> error = motion.velocity + 0.05 * 8.3 * np.sin(8.3 * t)
        >>> bool(np.std(error) < 0.002 * 0.05 * 8.3)
        True
        """
        if not isinstance(self.motion, Oscillation):
            raise AnalysisError(f"there is no oscillation to smooth: {self.motion.why}")
        return kinematics(self.track, self.motion, self.motion.derived.laws)
