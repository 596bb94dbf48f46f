"""The result of a run in words: measured values, damping, and captions of figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from pipeline.analyse import Analysis, Oscillation, Overdamped, Still
from pipeline.damping.laws import words_of
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.numerics.quantity import SHOWN, noun
from pipeline.registry.quantities import INPUTS
from springmass.report.budgets import budgets_of
from springmass.report.figures.phase_plot import turn_step
from springmass.report.figures.position import ZOOM_PERIODS, has_error_bars, is_long
from springmass.report.figures.rest_position import rest_moves
from springmass.report.motion_table import row_step
from springmass.report.tables import page_unit, pretty, pretty_number, raised

__all__ = ["LETTERS", "caption", "damping_sentence", "equation", "kept", "method", "typeset", "verdict"]

LETTERS = {"A0": "A₀", "gamma": "γ", "beta": "β", "mu": "μ"}


def kept(estimate: Estimate) -> str:
    """Write an estimate so that no line breaks inside it."""
    return _unbroken(pretty(estimate))


def _unbroken(text: str) -> str:
    return text.replace(" ", "\u00a0")


def equation(name: str, estimate: Estimate) -> str:
    """Write a parameter with its value or its upper limit.

    Examples
    --------
    >>> equation("beta", Estimate(0.235, 0.012, "1/(m s)")), equation("mu", UpperLimit(1e-5, 2e-5, "m/s"))
    ('β = 0.235 ± 0.012 m⁻¹ s⁻¹', 'μ < 4.7 × 10⁻⁵ m/s (95 %)')
    """
    sign = "" if isinstance(estimate, UpperLimit) else "= "
    return f"{LETTERS.get(name, name)} {sign}{pretty(estimate)}"


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
    """Return a message with numbers and units typeset as in the page's tables.

    Examples
    --------
    >>> typeset("gamma = (6.50 +- 0.12)e-03 1/s; left in, the amplitude changes by -0.4 mm (2.0%)")
    'γ = (6.50 ± 0.12) × 10⁻³ s⁻¹; left in, the amplitude changes by −0.4 mm (2.0\xa0%)'
    """
    for pattern, by in _SUBSTITUTES:
        message = pattern.sub(by, message)
    return message


def verdict(analysis: Analysis) -> tuple[str, ...]:
    """Return the result of a run in at most four sentences: values, damping, fit, main source of uncertainty."""
    motion = analysis.motion
    if isinstance(motion, Overdamped) or (isinstance(motion, Still) and "first_mode_period" in analysis.estimates):
        why = typeset(motion.why)
        return (f"{why[0].upper()}{why[1:]}.",)
    if isinstance(motion, Still):
        return ("Nothing oscillates in this recording; it gives rest position and noise only.",)
    found = analysis.estimates
    unit = analysis.track.unit
    moves = "bob swings" if unit == "m" else f"{noun(unit)} oscillates"
    measured = f"The {moves} with the period T\u00a0=\u00a0{kept(found['period'])}"
    if "spring_constant" in found:
        measured += f", which with the mass gives the spring constant k\u00a0=\u00a0{kept(found['spring_constant'])}"
    sentences = [f"{measured}.", damping_sentence(analysis, coefficients=True)]
    if not {finding.code for finding in analysis.findings} & _NOT_NOISE:
        sentences.append("The checks find nothing but noise in the residuals.")
    cause = _largest_cause(analysis)
    return (*sentences, cause) if cause else tuple(sentences)


def method(analysis: Analysis) -> tuple[str, ...]:
    """Return how the numbers were obtained, in sentences for a lab report; empty if nothing oscillates."""
    motion = analysis.motion
    if not isinstance(motion, Oscillation):
        return ()
    if "strongly_damped" in {finding.code for finding in analysis.findings}:
        sentences = ["The equation of motion was solved and fitted to the samples by least squares."]
    else:
        sentences = [
            "A sinusoid was fitted to the samples of every window of one or several periods by robust least squares; "
            "the period follows from the phases of the windows, and the damping from their amplitudes."
        ]
    if motion.method == "samples":
        sentences.append("Then the whole waveform was fitted to all samples.")
    if not motion.damping.by_statement:
        sentences.append("The damping laws were compared by χ² and by the Bayesian information criterion.")
    if (mass := motion.derived.effective_mass_kg) is not None:
        shares = {"spring_mass": "a share of the spring", "added_mass": "the air that the disc carries along"}
        moving = ["the bob", *(shares[x.name] for x in analysis.effects if x.included and x.name in shares)]
        sentences.append(
            f"The spring constant is k\u00a0=\u00a0mω² with the oscillating mass m\u00a0=\u00a0{kept(mass)}: "
            f"{_listed(moving)}."
        )
    rows = {row.name: row for row in budgets_of(analysis)}
    expanded = [
        f"U({symbol})\u00a0=\u00a0{_unbroken(f'{pretty_number(row.budget.expanded, 2)} {row.budget.estimate.unit}')}"
        for name, symbol in (("period", "T"), ("spring_constant", "k"))
        if (row := rows.get(name)) is not None
    ]
    sentences.append("Uncertainties are standard uncertainties, combined by the law of propagation (GUM).")
    if expanded:
        sentences.append(f"The expanded uncertainties for a coverage of 95.45\u00a0% are {' and '.join(expanded)}.")
    return tuple(sentences)


def _largest_cause(analysis: Analysis) -> str:
    """Return the main source of uncertainty of the spring constant, or else of the period, as a sentence."""
    rows = {row.name: row for row in budgets_of(analysis)}
    row = rows.get("spring_constant") or rows.get("period")
    if row is None or not row.contributions:
        return ""
    greatest = row.contributions[0]
    symbol = "k" if row.name == "spring_constant" else "T"
    label = INPUTS[greatest.name].label
    if round(100.0 * greatest.share) == 100:
        return f"The uncertainty of {symbol} comes almost entirely from the {label}."
    return f"The largest part of u({symbol})², {100.0 * greatest.share:.0f}\u00a0%, comes from the {label}."


_NOT_NOISE = frozenset(
    {
        "held_samples",
        "model_misfit",
        "no_law_fits",
        "not_sinusoidal",
        "quantised",
        "smoothed_sensor",
        "stated_law_rejected",
        "strongly_damped",
    }
)
"""Codes of findings with which the residuals are not noise, or are not checked."""
NAMED_LAWS = 2  # maximum number of named laws that cannot be ruled out


def damping_sentence(analysis: Analysis, *, coefficients: bool = False) -> str:
    """Return one sentence on the damping law that fits and the status of the others; empty if nothing oscillates.

    Parameters
    ----------
    analysis : Analysis
    coefficients : bool
        Whether to state the coefficients of the selected law and the damping rate, with the numbers of Table 1.
    """
    if not isinstance(analysis.motion, Oscillation):
        return ""
    damping, derived = analysis.motion.damping, analysis.motion.derived
    chosen = words_of(damping.best.law)
    span = f"{float(analysis.track.t[-1] - analysis.track.t[0]):.0f} s"
    if damping.best.rejected and damping.by_statement:
        return (
            f"The recording contradicts the stated law, {chosen}; state no law, or quote the amplitude against time "
            "instead of its coefficients."
        )
    if damping.best.rejected:
        return (
            f"No damping law describes how the amplitude falls; {chosen} is nearest, but quote the amplitude against "
            "time instead of its coefficients."
        )
    possible = [words_of(damping.fits[name].law) for name in damping.admissible if name != damping.selected]
    if len(damping.best.law.parameters) == 1:
        text = f"The amplitude does not fall measurably in {span}"
    elif possible and not damping.by_statement:
        text = f"{chosen[0].upper()}{chosen[1:]} fits best"
    else:
        text = f"The amplitude falls by {chosen}"
    if damping.by_statement:
        text += ", as you stated"
    if coefficients:
        stated = derived.coefficients if derived.laws[0].fit.name == damping.selected else {}
        text += "".join(f", {_unbroken(equation(name, x))}" for name, x in stated.items())
    if damping.by_statement:
        return f"{text}."
    if coefficients:
        text += f"; the damping rate at the start is λ\u00a0=\u00a0{_damping_rates(analysis.motion)}"
    if possible:
        more = len(possible) - NAMED_LAWS
        if more > 1:
            return f"{text}; {', '.join(possible[:NAMED_LAWS])} and {more} more laws cannot be ruled out in {span}."
        return f"{text}; {_listed(possible)} cannot be ruled out in {span}."
    others, rejected = len(damping.fits) - 1, sum(fit.rejected for fit in damping.fits.values())
    if not others:
        return f"{text}; no other law was tried."
    if rejected == others:
        return f"{text}; the recording rejects all {others} other laws."
    return f"{text}; of {others} other laws {rejected} are rejected and {others - rejected} unlikely."


def _listed(words: Sequence[str]) -> str:
    return " and ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"


def _damping_rates(motion: Oscillation) -> str:
    """Return the damping rate at the start and what it assumes."""
    derived = motion.derived
    return f"{kept(derived.estimates['damping_rate'])} {'by that law' if derived.law else 'for any law'}"


def caption(name: str, analysis: Analysis) -> str:
    """Return the caption of a figure.

    Parameters
    ----------
    name : str
        Name of the figure, as in :data:`springmass.report.figures.NAMES`.
    analysis : Analysis
    """
    if isinstance(analysis.motion, Overdamped):
        return f"{_subject(analysis)} with the fitted relaxation. Samples scatter by {_sigma(analysis)}."
    if isinstance(analysis.motion, Still):
        what = "two modes together" if "first_mode_period" in analysis.estimates else "nothing oscillates"
        return f"{_subject(analysis)}; {what}. Samples scatter by {_sigma(analysis)}."
    return _CAPTIONS[name](analysis, analysis.motion)


def _sigma(analysis: Analysis) -> str:
    noise = analysis.estimates["noise"]
    shown = SHOWN[analysis.track.unit]
    return kept(Estimate(shown.factor * noise.value, shown.factor * noise.u, shown.unit))


def _subject(analysis: Analysis) -> str:
    """Return the recorded quantity, capitalised for the start of a sentence."""
    unit = analysis.track.unit
    return "Distance from the sensor" if unit == "m" else noun(unit).capitalize()


def _position(analysis: Analysis, _: Oscillation) -> str:
    bars = "shown as error bars" if has_error_bars(analysis) else "too small for error bars to show"
    detail = f" The upper pair shows the whole recording, the lower pair its first {ZOOM_PERIODS} periods."
    rest = " The bottom panel shows the rest position of each window minus its mean, with u, and the fitted curve."
    return (
        f"{_subject(analysis)} and fit; below, the residuals divided by the noise of one sample, "
        f"σ\u00a0=\u00a0{_sigma(analysis)}, {bars}.{detail if is_long(analysis) else ''}"
        f" Flagged samples were left out of the fit and of the residuals.{rest if rest_moves(analysis) else ''}"
    )


def _amplitude(_: Analysis, motion: Oscillation) -> str:
    return (
        "Amplitude of each window (one period or a few) with one standard uncertainty u, and the damping laws; "
        f"below, the residuals of the selected law, {motion.damping.selected}, divided by u."
    )


def _phase(analysis: Analysis, motion: Oscillation) -> str:
    step = turn_step(motion)
    every = f" One turn in {step} is drawn." if step > 1 else ""
    value = noun(analysis.track.unit)
    what = "Velocity against displacement" if value == "distance" else f"Derivative of the {value} against the {value}"
    return f"{what} from rest; the colour shows the time.{every}"


def _energy(analysis: Analysis, motion: Oscillation) -> str:
    mass = motion.derived.effective_mass_kg
    of = f"the mass that oscillates, {kept(mass)}" if mass is not None else "one kilogram, as no mass was given"
    parts = "; at the bottom, kinetic and potential energy in the first periods" if analysis.track.unit == "m" else ""
    return (
        f"Energy of the oscillation, m ω² A²/2{_of_displacement(analysis)}, for {of}. The means of kinetic and "
        "potential energy over a period are one half of it each, and their markers alternate. Below, the deviation of "
        f"single amplitudes from the law{parts}. Error bars: scatter of each point. Band: standard uncertainty of the "
        "law, with errors common to all points."
    )


def _of_displacement(analysis: Analysis) -> str:
    over = {"m/s": "ω", "m/s^2": "ω²"}.get(analysis.track.unit)
    return f" with A the recorded amplitude over {over}" if over else ""


def _drag(analysis: Analysis, motion: Oscillation) -> str:
    friction = "; friction is left out" if motion.damping.best.drag_term("mu") is not None else ""
    return (
        "Effective drag coefficient against amplitude, −dA/dt · 3π m/(2 ω ρ S A²)"
        f"{_of_displacement(analysis)}: that of purely quadratic drag on the disc with the same energy loss, losses "
        f"of the spring included{friction}. Points: slopes of the logarithm of the amplitude in stretches of the run, "
        "with their scatter. Band: standard uncertainty of the law with masses, disc, air and scale. If the "
        "coefficient depends on the amplitude, a constant does not describe the drag."
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
    above = f"The {rate} over the whole recording; below it, " if is_long(analysis) else ""
    first = f"{first[:1].lower()}{first[1:]}" if above else first
    return (
        f"{above}{first} over {periods}, from the fit and its covariance, not by differences of "
        f"neighbours. The panel below{whole}: {rate} minus that of the selected law, with a band of ±u. Bottom: the "
        "standard uncertainties, which are larger at the ends. Errors of clock and scale are not included. "
        f"motion.csv holds {rows}."
    )


def _classic(_: Analysis, motion: Oscillation) -> str:
    return (
        "The lab report's method compared with this analysis. Above: the two sampled maxima that are seven periods "
        "apart, and the extremes of the whole recording, whose half distance it takes as amplitude, noise and false "
        "echoes included. Below: half the distance between the extremes within 1.5 s of every sample, and the "
        "exponential through the first of these. Points and black curve "
        f"({motion.damping.selected}) are of this analysis."
    )


def _logarithmic(_: Analysis, motion: Oscillation) -> str:
    return (
        "Amplitude on a logarithmic axis, on which an exponential (linear drag) is a straight line. The solid line is "
        f"the selected law, {motion.damping.selected}."
    )


def _frequency(_: Analysis, motion: Oscillation) -> str:
    model = "changes with the amplitude" if motion.phase.backbone is not None else "is constant"
    return (
        "Frequency of stretches of the run against their mean amplitude, with one standard uncertainty u. The line is "
        f"the fitted model, in which the frequency {model}."
    )


def _spectrum(_: Analysis, __: Oscillation) -> str:
    return (
        "Amplitude spectrum of the recording and of the residuals of the fit (Hann window). The highest peaks are "
        "labelled. A peak of the residuals is a motion that the fit does not describe."
    )


_CAPTIONS: dict[str, Callable[[Analysis, Oscillation], str]] = {
    "position": _position,
    "amplitude": _amplitude,
    "logarithmic": _logarithmic,
    "frequency": _frequency,
    "spectrum": _spectrum,
    "drag": _drag,
    "energy": _energy,
    "motion": _motion,
    "phase": _phase,
    "classic": _classic,
}
