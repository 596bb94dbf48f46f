"""The result of an analysis: one run with its estimates, effects and findings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from uncertainties import nominal_value

from pipeline.bench.scene import Scene
from pipeline.checks.echoes import count_quality
from pipeline.damping.select import NO_LAWS, Damping
from pipeline.findings.finding import Finding
from pipeline.motion.fitted import Oscillation
from pipeline.motion.kinds import Motion
from pipeline.motion.relaxation import Relaxation
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.threads import one_thread
from pipeline.options import Options
from pipeline.results.budget import Budget
from pipeline.results.contour import Contour, contour
from pipeline.results.curves import Curve, Smoothed, drag_curve, energy_curve, kinematics
from pipeline.results.derive import Derived
from pipeline.results.effects import Effect
from pipeline.samples.condition import Samples
from pipeline.track import U8, UNUSABLE, Track


@dataclass(frozen=True, eq=False)
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
    why: str  # why the motion is no oscillation of many cycles, in words; empty if it is one

    @property
    def oscillation(self) -> Oscillation | None:
        """The fit, if the motion is an oscillation; what every kind has is in the other attributes."""
        return self.motion if isinstance(self.motion, Oscillation) else None

    @property
    def damping(self) -> Damping:
        """The damping laws; there are none without an oscillation."""
        return self.motion.damping if isinstance(self.motion, Oscillation) else NO_LAWS

    @property
    def budgets(self) -> Mapping[str, Budget]:
        """The uncertainty budgets that are shown, by name: those of an oscillation."""
        return self.derived.budgets if isinstance(self.motion, Oscillation) else {}

    @property
    def ok(self) -> bool:
        """Whether the run oscillates or relaxes, so that there is something to report."""
        return isinstance(self.motion, Oscillation | Relaxation)

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

    @cached_property
    @one_thread
    def smoothed(self) -> Smoothed | None:
        """Position, velocity and acceleration at every sample from the fit of an oscillation, with their uncertainties.

        >>> import numpy as np
        >>> from pipeline.analyse import analyse
        >>> t = np.arange(1000) / 100
        >>> y = 0.2 + 0.05 * np.cos(8.3 * t) + 3e-4 * np.random.default_rng(1).standard_normal(1000)
        >>> motion = analyse(Track.from_arrays(t, y)).smoothed
        >>> error = motion.velocity + 0.05 * 8.3 * np.sin(8.3 * t)
        >>> bool(np.std(error) < 0.002 * 0.05 * 8.3)
        True
        """
        motion = self.oscillation
        return None if motion is None else kinematics(self.track, motion, self.derived.laws)

    def energy_curve(self) -> Curve | None:
        """Return the mechanical energy against time with its band, in J, or in J/kg if no mass is known."""
        motion, derived = self.oscillation, self.derived
        if motion is None or derived.half_stiffness is None:
            return None
        unit = "J/kg" if derived.effective_mass_kg is None else "J"
        return energy_curve(motion.damping, motion.windows, derived.half_stiffness, derived.laws, unit)

    def drag_curve(self) -> Curve | None:
        """Return the drag coefficient against amplitude with its band."""
        motion, length = self.oscillation, self.derived.drag_length
        if motion is None or length is None:
            return None
        return drag_curve(motion.damping, motion.windows, length, self.derived.laws)

    @one_thread
    def contour(self, shares: tuple[float, ...]) -> Contour | None:
        """Return the regions of two parameters of the selected law that hold the truth with given probabilities."""
        rate, scale = map(nominal_value, self.derived.scales)
        return None if self.oscillation is None else contour(self.oscillation, (rate, scale), shares)
