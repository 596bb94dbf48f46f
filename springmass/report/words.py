"""What the page says in words of a run: the verdict on its damping, and its figures' captions."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from pipeline.analyse import Analysis, Oscillation, Overdamped, Still
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.quantity import SHOWN, noun
from springmass.report.figures.phase_plot import turn_step
from springmass.report.figures.position import ZOOM_PERIODS, has_error_bars, is_long
from springmass.report.figures.rest_position import rest_moves
from springmass.report.motion_table import row_step
from springmass.report.tables import page_unit, pretty, raised

__all__ = ["LETTERS", "caption", "kept", "typeset", "verdict"]

LETTERS = {"A0": "A₀", "gamma": "γ", "beta": "β", "mu": "μ"}


def kept(estimate: Estimate) -> str:
    """Write an estimate so that no line breaks inside it."""
    return pretty(estimate).replace(" ", "\u00a0")


_SUBSTITUTES = (
    (re.compile(r"(?<=[\d)] )(1/\(m s\)|1/s|m/s\^2|degC)(?!\w)"), lambda found: page_unit(found[1])),
    (re.compile(r"(?<=[\d)])e([+-]\d+)\b"), lambda found: f" × 10{raised(int(found[1]))}"),
    (re.compile(r"\+-"), "±"),
    (re.compile(r"(?<![\w.+-])-(?=\d)"), "−"),
    (re.compile(r"\b(gamma|beta|mu)(?= = )"), lambda found: LETTERS[found[1]]),
    (re.compile(r"(?<=\d),(?=\d{3}(?!\d))"), "\u202f"),
    (re.compile(r"(?<=\d)%"), "\u00a0%"),
    (re.compile(r"\bchi-square\b"), "χ²"),
)


def typeset(message: str) -> str:
    """Return a message as the page's tables write numbers and units.

    Examples
    --------
    >>> typeset("gamma = (6.50 +- 0.12)e-03 1/s; left in, the amplitude changes by -0.4 mm (2.0%)")
    'γ = (6.50 ± 0.12) × 10⁻³ s⁻¹; left in, the amplitude changes by −0.4 mm (2.0\xa0%)'
    """
    for pattern, by in _SUBSTITUTES:
        message = pattern.sub(by, message)
    return message


def verdict(analysis: Analysis) -> tuple[str, ...]:
    """Return what holds of a run, in two sentences at most: what was measured, and how the motion is damped."""
    if isinstance(analysis.motion, Overdamped):
        why = typeset(analysis.motion.why)
        return (f"{why[0].upper()}{why[1:]}.",)
    if "first_mode_period" in analysis.estimates and isinstance(analysis.motion, Still):
        why = typeset(analysis.motion.why)
        return (f"{why[0].upper()}{why[1:]}.",)
    if isinstance(analysis.motion, Still):
        return ("Nothing oscillates in this record; rest position and noise are all that it gives.",)
    found = analysis.estimates
    unit = analysis.track.unit
    moves = "bob swings" if unit == "m" else f"{noun(unit)} oscillates"
    measured = f"The {moves} with the period T\u00a0=\u00a0{kept(found['period'])}"
    if "spring_constant" in found:
        measured += f", which makes the spring constant k\u00a0=\u00a0{kept(found['spring_constant'])}"
    return (f"{measured}.", _damped(analysis.motion.damping, analysis.motion.derived.coefficients))


def _damped(damping: Damping, stated: Mapping[str, Estimate]) -> str:
    """Return what became of the damping laws, in a sentence, with the numbers of Table 1."""
    chosen = damping.best.law.words
    if damping.best.rejected:
        return (
            f"No damping law describes how the amplitude falls; {chosen} comes nearest, and its parameters must not be "
            "used: quote the amplitude against time."
        )
    if damping.selected == "none":
        text = "The amplitude does not fall by more than this record can tell"
    else:
        text = f"Its amplitude falls by {chosen}"
    parameters = [
        f"{LETTERS.get(name, name)}\u00a0=\u00a0{kept(stated[name])}"
        for name in damping.best.joint.names
        if name in stated
    ]
    text += f", {', '.join(parameters)}" if parameters else ""
    others = [damping.fits[name].law.words for name in damping.admissible if name != damping.selected]
    if others:
        return f"{text}; as far as this record can tell, as good: {'; '.join(others)}."
    tried, rejected = len(damping.fits) - 1, sum(fit.rejected for fit in damping.fits.values())
    if rejected == tried:
        return f"{text}; the record rejects every other law tried."
    return f"{text}; of the {tried} other laws tried the record rejects {rejected}, the rest are unlikely."


def caption(name: str, analysis: Analysis) -> str:
    """Return the caption of a figure.

    Parameters
    ----------
    name : str
        As in :data:`springmass.report.figures.MAKERS`.
    analysis : Analysis
    """
    if isinstance(analysis.motion, Overdamped):
        return f"{_subject(analysis)} with the fitted relaxation. Samples scatter by {_sigma(analysis)}."
    if isinstance(analysis.motion, Still):
        what = "two modes at once" if "first_mode_period" in analysis.estimates else "nothing oscillates"
        return f"{_subject(analysis)}; {what}. Samples scatter by {_sigma(analysis)}."
    return _CAPTIONS[name](analysis, analysis.motion)


def _sigma(analysis: Analysis) -> str:
    noise = analysis.estimates["noise"]
    shown = SHOWN[analysis.track.unit]
    return kept(Estimate(shown.factor * noise.value, shown.factor * noise.u, shown.unit))


def _subject(analysis: Analysis) -> str:
    """What was recorded, at the head of a sentence."""
    unit = analysis.track.unit
    return "Distance from the sensor" if unit == "m" else noun(unit).capitalize()


def _position(analysis: Analysis, _: Oscillation) -> str:
    bars = "shown as error bars" if has_error_bars(analysis) else "too small for error bars to show"
    detail = f" Above the whole record, below its first {ZOOM_PERIODS} periods (shaded above)."
    rest = " At the bottom the rest position of single windows less its mean, with u, and the curve that it follows."
    return (
        f"{_subject(analysis)} with the fitted motion; beneath, what the fit leaves, over the noise of "
        f"one sample, σ\u00a0=\u00a0{_sigma(analysis)}, {bars}.{detail if is_long(analysis) else ''}"
        f" Flagged samples were left out of the fit and of the residuals.{rest if rest_moves(analysis) else ''}"
    )


def _amplitude(_: Analysis, motion: Oscillation) -> str:
    return (
        "Amplitude in windows of one period or a few, with one standard uncertainty u, and every law, named where it "
        "matters; "
        f"beneath, the residuals of the selected law, {motion.damping.selected}, over u."
    )


def _phase(analysis: Analysis, motion: Oscillation) -> str:
    step = turn_step(motion)
    every = f" One turn in {step} is drawn." if step > 1 else ""
    value = noun(analysis.track.unit)
    what = "Velocity against displacement" if value == "distance" else f"Derivative of the {value} against the {value}"
    return f"{what} from rest; colour tells the time.{every}"


def _energy(analysis: Analysis, motion: Oscillation) -> str:
    mass = motion.derived.effective_mass_kg
    of = f"the mass that oscillates, {kept(mass)}" if mass is not None else "one kilogram, as no mass was given"
    parts = ", and the parts as they change into each other" if analysis.track.unit == "m" else ""
    return (
        f"Energy of the oscillation, m ω² A²/2{_of_displacement(analysis)}, for {of}, with its kinetic and potential "
        "parts, one half each in the mean of a period; beneath, what single amplitudes "
        f"deviate from the law{parts}. "
        "Points bear their own scatter. The band is one standard uncertainty of the law, with all that points share: "
        "mass, frequency, the distances' scale and the choice among admissible laws."
    )


def _of_displacement(analysis: Analysis) -> str:
    over = {"m/s": "ω", "m/s^2": "ω²"}.get(analysis.track.unit)
    return f" with A the recorded amplitude over {over}" if over else ""


def _drag(analysis: Analysis, motion: Oscillation) -> str:
    friction = "; friction is left out" if motion.damping.best.drag_term("mu") is not None else ""
    return (
        "Drag coefficient against amplitude: what purely quadratic drag on the disc would need to take the energy that "
        f"the record loses, −dA/dt · 3π m/(2 ω ρ S A²){_of_displacement(analysis)}, the spring's own losses "
        f"included{friction}. Points are slopes of the amplitude's logarithm through stretches of the record and bear "
        "their own scatter; the band is one "
        "standard uncertainty of the law with masses, disc, air and scale. A coefficient that falls with the "
        "amplitude is one that a constant C does not describe."
    )


def _motion(analysis: Analysis, _: Oscillation) -> str:
    periods = f"the first {ZOOM_PERIODS} periods" if is_long(analysis) else "time"
    step = row_step(analysis)
    rows = "position, velocity and acceleration at every sample" if step == 1 else f"all three at one sample in {step}"
    whole = " over the whole record (the periods above are shaded)" if is_long(analysis) else ""
    first, rate = "Velocity v and acceleration a", "velocity"
    if analysis.track.unit != "m":
        first, rate = f"First and second derivative of the {noun(analysis.track.unit)}", "first derivative"
        rows = rows.replace("position, velocity and acceleration", "the value and its derivatives")
    above = f"The {rate} over the whole record; beneath, " if is_long(analysis) else ""
    first = f"{first[:1].lower()}{first[1:]}" if above else first
    return (
        f"{above}{first} over {periods}, from an oscillator smoother: every sample speaks on every "
        f"other, nothing is differenced. Beneath{whole}, what the {rate} differs from the fitted law's, in its band "
        "of one standard uncertainty u, and u of both: larger at the edges, where one side is missing. Clock and "
        f"scale, which move all alike, are not in u. motion.csv holds {rows}."
    )


def _classic(_: Analysis, motion: Oscillation) -> str:
    return (
        "What the lab report's own method takes, over this analysis. Above, the two sampled maxima whose distance in "
        "time is seven periods, each to a sample's width, and the extremes of the whole record, half of whose distance "
        "is its amplitude: noise and false echoes are among them. Beneath, half of what lies between the extremes in "
        "1.5 s, at every sample, with the exponential that it "
        f"fits through the first of these; points and black curve, {motion.damping.selected}, are this analysis's."
    )


_CAPTIONS: dict[str, Callable[[Analysis, Oscillation], str]] = {
    "position": _position,
    "amplitude": _amplitude,
    "drag": _drag,
    "energy": _energy,
    "motion": _motion,
    "phase": _phase,
    "classic": _classic,
}
