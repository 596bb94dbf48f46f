"""What the page says in words of a run: the verdict on its damping, and its figures' captions."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.analyse import Analysis, Oscillation, Overdamped, Still
from pipeline.numerics.estimate import Estimate
from springmass.report.figures.phase_plot import turn_step
from springmass.report.figures.position import ZOOM_PERIODS, has_error_bars, is_long
from springmass.report.motion_table import row_step
from springmass.report.tables import pretty

__all__ = ["LETTERS", "caption", "kept", "verdict"]

LETTERS = {"A0": "A₀", "gamma": "γ", "beta": "β", "mu": "μ"}


def kept(estimate: Estimate) -> str:
    """Write an estimate so that no line breaks inside it."""
    return pretty(estimate).replace(" ", "\u00a0")


def verdict(analysis: Analysis) -> str:
    """Return what became of the damping laws, in a sentence or a few."""
    if isinstance(analysis.motion, Overdamped):
        return f"{analysis.motion.why[0].upper()}{analysis.motion.why[1:]}.".replace("+-", "±")
    if isinstance(analysis.motion, Still):
        return "Nothing oscillates in this record; rest position and noise are all that it gives."
    damping = analysis.motion.damping
    chosen = damping.best.law.words
    if damping.best.rejected:
        return f"No damping law holds; the least bad is {chosen}, and its parameters must not be used."
    parameters = [
        f"{LETTERS.get(name, name)}\u00a0=\u00a0{kept(x)}"
        for name, x in damping.best.joint.estimates().items()
        if name != "A0"
    ]
    text = f"The amplitude is described by {chosen}" + (f": {', '.join(parameters)}." if parameters else ".")
    if damping.selected == "none":
        text = "The amplitude does not fall by more than this record can tell."
    rejected = [fit.law.words for fit in damping.fits.values() if fit.rejected]
    if rejected:
        text += f" Rejected: {'; '.join(rejected)}."
    others = [damping.fits[name].law.words for name in damping.admissible if name != damping.selected]
    if others:
        text += f" As good, as far as this record can tell: {'; '.join(others)}."
    return text


def caption(name: str, analysis: Analysis) -> str:
    """Return the caption of a figure.

    Parameters
    ----------
    name : str
        As in :data:`springmass.report.figures.MAKERS`.
    analysis : Analysis
    """
    if isinstance(analysis.motion, Overdamped):
        return f"Distance from the sensor with the fitted relaxation. Samples scatter by {_sigma(analysis)}."
    if isinstance(analysis.motion, Still):
        return f"Distance from the sensor; nothing oscillates. Samples scatter by {_sigma(analysis)}."
    return _CAPTIONS[name](analysis, analysis.motion)


def _sigma(analysis: Analysis) -> str:
    noise = analysis.estimates["noise"]
    return kept(Estimate(1e3 * noise.value, 1e3 * noise.u, "mm"))


def _position(analysis: Analysis, _: Oscillation) -> str:
    bars = "shown as error bars" if has_error_bars(analysis) else "too small for error bars to show"
    detail = f" Above the whole record, below its first {ZOOM_PERIODS} periods (shaded above)."
    return (
        "Distance from the sensor with the fitted motion; beneath, what the fit leaves, over the noise of "
        f"one sample, σ\u00a0=\u00a0{_sigma(analysis)}, {bars}.{detail if is_long(analysis) else ''}"
        " Flagged samples were left out of the fit and of the residuals."
    )


def _amplitude(_: Analysis, motion: Oscillation) -> str:
    return (
        "Amplitude in windows of one period or a few, with one standard uncertainty u, and every law; "
        f"beneath, the residuals of the selected law, {motion.damping.selected}, over u."
    )


def _phase(_: Analysis, motion: Oscillation) -> str:
    step = turn_step(motion)
    every = f" One turn in {step} is drawn." if step > 1 else ""
    return f"Velocity against displacement from rest; colour tells the time.{every}"


def _energy(_: Analysis, motion: Oscillation) -> str:
    mass = motion.derived.effective_mass_kg
    of = f"the mass that oscillates, {kept(mass)}" if mass is not None else "one kilogram, as no mass was given"
    return (
        f"Energy of the oscillation, m ω² A²/2, for {of}; beneath, what single amplitudes deviate from the law. "
        "Points bear their own scatter. The band is one standard uncertainty of the law, with all that points share: "
        "mass, frequency, the distances' scale and the choice among admissible laws."
    )


def _drag(_: Analysis, motion: Oscillation) -> str:
    friction = "; friction is left out" if "mu" in motion.damping.best.joint.names else ""
    return (
        "Drag coefficient against amplitude: what purely quadratic drag on the disc would need to take the energy that "
        f"the record loses, −dA/dt · 3π m/(2 ω ρ S A²), the spring's own losses included{friction}. Points are slopes "
        "of the amplitude's logarithm through stretches of the record and bear their own scatter; the band is one "
        "standard uncertainty of the law with masses, disc, air and scale. A coefficient that falls with the "
        "amplitude is one that a constant C does not describe."
    )


def _motion(analysis: Analysis, _: Oscillation) -> str:
    periods = f"the first {ZOOM_PERIODS} periods" if is_long(analysis) else "time"
    step = row_step(analysis)
    rows = "position, velocity and acceleration at every sample" if step == 1 else f"all three at one sample in {step}"
    whole = " over the whole record (the periods above are shaded)" if is_long(analysis) else ""
    return (
        f"Velocity v and acceleration a over {periods}, from an oscillator smoother: every sample speaks on every "
        f"other, nothing is differenced. Beneath{whole}, what the velocity differs from the fitted law's, in its band "
        "of one standard uncertainty u, and u of both: larger at the edges, where one side is missing. Clock and "
        f"scale, which move all alike, are not in u. motion.csv holds {rows}."
    )


_CAPTIONS: dict[str, Callable[[Analysis, Oscillation], str]] = {
    "position": _position,
    "amplitude": _amplitude,
    "drag": _drag,
    "energy": _energy,
    "motion": _motion,
    "phase": _phase,
}
