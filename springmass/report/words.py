"""Results in words: the summary, the damping law and the method of a run, and whether several runs agree."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.analyse import Analysis, Oscillation, Rest
from pipeline.damping.laws import words_of
from pipeline.quantities import INPUTS
from pipeline.results.budget import Contribution
from pipeline.units import noun
from springmass.comparing.comparison import SpringComparison, comparison_words
from springmass.result.advice import harm_of, sentence
from springmass.result.budget_tables import budgets_of
from springmass.result.grades import grades_of, grades_text
from springmass.result.table1 import is_about
from springmass.typeset import prefixed, pretty, pretty_number, typeset, unbroken


def method(analysis: Analysis) -> tuple[str, ...]:
    """Return how the numbers were obtained, in sentences for a lab report; empty if nothing oscillates."""
    if (motion := analysis.oscillation) is None:
        return ()
    if is_about(analysis, "solved"):
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
    if (mass := analysis.derived.effective_mass_kg) is not None:
        shares = {"spring_mass": "a share of the spring", "added_mass": "the air that the disc carries along"}
        moving = ["the bob", *(shares[x.name] for x in analysis.effects if x.included and x.name in shares)]
        sentences.append(
            "The spring constant is k\u00a0=\u00a0mω² with the oscillating mass "
            f"m\u00a0=\u00a0{unbroken(pretty(mass))}: {listed(moving)}."
        )
    rows = {row.name: row for row in budgets_of(analysis)}
    expanded = [
        f"U({symbol})\u00a0=\u00a0{unbroken(f'{pretty_number(row.budget.expanded, 2)} {row.budget.estimate.unit}')}"
        for name, symbol in (("period", "T"), ("spring_constant", "k"))
        if (row := rows.get(name)) is not None
    ]
    sentences.append("Uncertainties are standard uncertainties, combined by the law of propagation (GUM).")
    if expanded:
        sentences.append(f"The expanded uncertainties for a coverage of 95.45\u00a0% are {' and '.join(expanded)}.")
    return tuple(sentences)


NAMED_LAWS = 2  # maximum number of named laws that cannot be ruled out


def damping_sentence(analysis: Analysis) -> str:
    """Return one sentence on the damping law that fits and the status of the others; empty if nothing oscillates."""
    damping, quoted = analysis.damping, analysis.derived.quoted
    if not damping.fits:
        return ""
    if isinstance(analysis.motion, Oscillation) and analysis.motion.phase.walk is not None:
        return "Amplitude and phase wander at random, so no damping law was fitted to them."
    chosen = words_of(damping.best.law)
    used = analysis.track.t[analysis.used]
    span = f"{float(used.max() - used.min()):.0f} s"
    if damping.best.rejected and damping.by_statement:
        return (
            f"The recording contradicts the stated law, {chosen}; state no law, or quote the amplitude against time "
            "instead of its coefficients."
        )
    if damping.best.rejected:
        nearest = "by far the nearest, and u of its coefficients was increased"
        if not quoted:
            nearest = "nearest, but others are nearly as good"
        return (
            f"No damping law fits to within the scatter; {chosen} is {nearest}. Quote the amplitude against time "
            "(amplitude.csv), not a damping rate."
        )
    possible = [words_of(damping.fits[name].law) for name in damping.possible if name != damping.selected]
    if damping.growth_rate:
        text = "The amplitude grows exponentially"
    elif len(damping.best.law.parameters) == 1:
        text = f"The amplitude does not fall measurably in {span}"
    elif possible and not damping.by_statement:
        text = f"{chosen[0].upper()}{chosen[1:]} fits best"
    else:
        text = f"The amplitude falls by {chosen}"
    if damping.by_statement:
        return f"{text}, as you stated."
    if possible:
        more = len(possible) - NAMED_LAWS
        if more > 1:
            possible = [*possible[:NAMED_LAWS], f"{more} more laws"]
        ruled_out = f"{listed(possible)} cannot be ruled out in {span}"
        rate = grades_of(analysis).get("damping_rate")
        if rate is None or rate.grade == "do not quote":
            return f"{text}; {ruled_out}."
        rate_words = "The damping rate may be quoted: it" if rate.grade == "sound" else "The damping rate"
        return f"{text}; {ruled_out}. {rate_words} allows for all of them."
    others, rejected = len(damping.fits) - 1, sum(fit.rejected for fit in damping.fits.values())
    if not others:
        return f"{text}; no other law was tried."
    if rejected in (0, others):
        all_others = "the other law is" if others == 1 else f"all {others} other laws are"
        return f"{text}; {all_others} {'rejected' if rejected else 'unlikely'}."
    ruled_out = f"{rejected} {'is' if rejected == 1 else 'are'} rejected and {others - rejected} unlikely"
    return f"{text}; of {others} other laws {ruled_out}."


def verdict(compared: SpringComparison) -> list[str]:
    """Return whether several runs agree on one spring, and what explains their periods, in sentences."""
    return [typeset(text) for text in (compared.comparison.message, *comparison_words(compared))]


def listed(words: Sequence[str]) -> str:
    """Join words with commas and an "and"."""
    return " and ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"


def summary(analysis: Analysis) -> tuple[tuple[str, str], ...]:
    """Return (title, text) of each part of the summary."""
    motion, warnings = analysis.oscillation, [f for f in analysis.findings if f.severity != "info"]
    ordered = sorted(warnings, key=lambda f: harm_of(f.code, f.severity))
    to_do = ordered[0].advice if ordered else ""
    if motion is None:
        why = sentence(typeset(analysis.why))
        if isinstance(analysis.motion, Rest):
            why = "Nothing oscillates in this recording; it gives mean and noise only."
        return (("Result", why), *((("What to do", to_do),) if to_do else ()))
    greatest = _greatest(analysis)
    if not to_do:
        to_do = "Nothing needs attention."
        if greatest is not None:
            symbol, it = greatest
            way = "record longer" if it.kind == "A" else f"find the {INPUTS[it.name].label} more accurately"
            to_do += f" To know {symbol} better, {way}."
    if (
        "spring_constant" not in analysis.estimates
        and analysis.scene.bob_mass_kg is None
        and analysis.scene.hangs_on_spring
        and analysis.track.unit == "m"
    ):
        to_do += " For the spring constant, state the mass."
    return (("Values", _values(analysis, motion)), ("How sure", _trust(analysis, greatest)), ("What to do", to_do))


def _values(analysis: Analysis, motion: Oscillation) -> str:
    x, unit = analysis.estimates, analysis.track.unit
    moves = "bob swings" if unit == "m" else f"{noun(unit)} oscillates"
    parts = [f"the {moves} with the period T\u00a0=\u00a0{unbroken(pretty(x['period']))}"]
    if "spring_constant" in x:
        parts.append(f"the mass gives the spring constant k\u00a0=\u00a0{unbroken(pretty(x['spring_constant']))}")
    start, size = f"{motion.damping.t0:.2f}\u00a0s", unbroken(pretty(prefixed(x["amplitude"])))
    parts.append(f"its amplitude by the fit at t\u00a0=\u00a0{start} is A₀\u00a0=\u00a0{size}")
    if "damping_rate" in x:
        parts.append(f"its damping rate at the start is λ\u00a0=\u00a0{unbroken(pretty(x['damping_rate']))}")
    return f"{sentence('; '.join(parts))} {damping_sentence(analysis)}"


def _trust(analysis: Analysis, greatest: tuple[str, Contribution] | None) -> str:
    noise = "more than noise" if is_about(analysis, "residuals") else "only noise"
    text = f"{grades_text(analysis, page=True)} The fit leaves {noise} in the residuals"
    if greatest is not None:
        symbol, it = greatest
        text += f"; {100.0 * it.share:.0f}\u00a0% of u({symbol})² comes from the {INPUTS[it.name].label}"
    return f"{text}."


def _greatest(analysis: Analysis) -> tuple[str, Contribution] | None:
    """Return the largest part of the variance of the spring constant, or else of the period, with its symbol."""
    rows = {row.name: row.contributions for row in budgets_of(analysis)}
    chosen = ((symbol, rows[name][0]) for name, symbol in (("spring_constant", "k"), ("period", "T")) if rows.get(name))
    return next(chosen, None)
