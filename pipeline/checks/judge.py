"""The judge: tests of the residual in order, and what they add to the uncertainties.

A test fires with a stated probability, or above a size below which no user would act. One that explains the residual
takes its part away before the next; what no named cause explains is ``model_misfit``.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.bench.scene import Scene
from pipeline.bench.sensor_filter import SensorFilter
from pipeline.checks.half import half_frequency
from pipeline.checks.limits import beyond_limits
from pipeline.checks.model import colour, slow_change
from pipeline.checks.residual import Misfit, Outcome, Residual, residual_of
from pipeline.checks.rounding import rounding
from pipeline.checks.sensor import held, held_count, held_numbers, smoothed
from pipeline.checks.shape import folded_shape
from pipeline.motion.at_rest import Rest
from pipeline.motion.fitted import Oscillation
from pipeline.motion.kinds import Motion
from pipeline.notice import Notice
from pipeline.parts.lost_rows import LostRows
from pipeline.samples.condition import Samples

# The tests of the residual in order.
TESTS: tuple[Callable[[Residual], Outcome | None], ...] = (
    half_frequency,
    folded_shape,
    held,
    smoothed,
    colour,
)


def judge(
    samples: Samples, motion: Motion, scene: Scene, lost: LostRows | None = None
) -> tuple[tuple[Notice, ...], tuple[Misfit, ...]]:
    """Return what the limits and the tests found, and what it adds to the uncertainties.

    A solution of the equation of motion is held against the limits and tested for slow changes only: strong damping
    distorts every period, which would look like a shape. A relaxation and two modes are accepted by such a test of
    their fit. Of a bob at rest only a sensor that holds its readings shows.
    """
    if not isinstance(motion, Oscillation):
        repeats = held_count(samples) if isinstance(motion, Rest) else 1
        numbers_of_held = held_numbers(repeats, 1.0 / samples.track.rate_hz)
        return ((Notice("held_samples", numbers_of_held),) if repeats > 1 else ()), ()
    fitted = motion
    if (walk := motion.phase.walk) is not None:
        spread = Misfit("random_excitation", {"amplitude": walk.spread})
        return (Notice("random_excitation", {"wander_rad": walk.wander, "amplitude_m": walk.amplitude}),), (spread,)
    outcomes = list(beyond_limits(samples, fitted, spring=scene.hangs_on_spring))
    if lost is not None:
        missing = {"places": lost.places, "share": lost.share}
        outcomes.append(Outcome("lost_rows", missing, Misfit("lost_rows", {"clock": lost.share})))
    residual = residual_of(samples, fitted, SensorFilter.of(scene, samples.track.rate_hz))
    for test in (slow_change,) if fitted.method == "equation" else TESTS:
        if (outcome := test(residual)) is not None:
            outcomes.append(outcome)
            residual = residual.less(outcome)
    numbers: dict[str, dict[str, float | str | None]] = {}
    for one in outcomes:
        if one.numbers is not None:
            numbers.setdefault(one.code, {}).update(one.numbers)
    if "model_misfit" in numbers:
        numbers["model_misfit"]["scatter_excess_m"] = fitted.damping.scatter.excess or None
    if "not_sinusoidal" in numbers:
        on_spring = scene.hangs_on_spring and not samples.track.unit.startswith("rad")
        numbers["not_sinusoidal"]["spring" if on_spring else "no_spring"] = ""
    found = tuple(Notice(code, each) for code, each in numbers.items())
    misfits = (*(one.misfit for one in outcomes), rounding(samples, fitted))
    return found, tuple(misfit for misfit in misfits if misfit is not None)
