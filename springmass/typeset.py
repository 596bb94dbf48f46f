"""How numbers, units and the standing of a law are written: on a page, in a table and in LaTeX."""

import math
import re
import unicodedata
from typing import NamedTuple

from acquisition.errors import visible
from pipeline.damping.law_fit import LawFit
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate, UpperLimit
from pipeline.several.joint import JointDamping


class _Written(NamedTuple):
    """How a unit is written: for siunitx, on the page, and with a prefix.

    A prefix is (upper limit of the value, factor, unit with its prefix), the smallest limit first.
    """

    tex: str
    page: str | None = None  # as it is, with powers raised
    prefixes: tuple[tuple[float, float, str], ...] = ()


_UNITS = {
    "1": _Written("", ""),
    # Periods stay in seconds down to 0.1 s.
    "s": _Written(r"\second", prefixes=((1e-3, 1e6, "µs"), (0.1, 1e3, "ms"))),
    "Hz": _Written(r"\hertz"),
    "rad": _Written(r"\radian"),
    "rad/s": _Written(r"\radian\per\second"),
    "N/m": _Written(r"\newton\per\metre"),
    "m": _Written(r"\metre", prefixes=((1e-3, 1e6, "µm"), (1.0, 1e3, "mm"))),
    "kg": _Written(r"\kilogram", prefixes=((1e-3, 1e6, "mg"), (1.0, 1e3, "g"))),
    "m/s": _Written(r"\metre\per\second", prefixes=((1e-4, 1e6, "µm/s"), (0.1, 1e3, "mm/s"))),
    "1/s": _Written(r"\per\second", "s⁻¹"),
    "1/(m s)": _Written(r"\per\metre\per\second", "m⁻¹ s⁻¹"),
    "m^(1-n)/s": _Written(r"\metre^{1-n}\per\second"),
    "V": _Written(r"\volt"),
    "N": _Written(r"\newton"),
    "m/s^2": _Written(r"\metre\per\second\squared"),
    "rad/s^2": _Written(r"\radian\per\second\squared"),
    "1/m": _Written(r"\per\metre"),
    "1/rad": _Written(r"\per\radian"),
    "degC": _Written(r"\degreeCelsius", "°C"),
    "Pa": _Written(r"\pascal"),
}
_RAISED = dict(zip("-0123456789n", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ", strict=True))
_SUPERSCRIPT = str.maketrans(_RAISED)
_POWER = re.compile(r"\^(?:\(([\dn-]+)\)|([\dn-]+))")
MANY_FREEDOM = 1e6  # degrees of freedom from which they are written as infinite


def count(number: int, noun: str) -> str:
    """Return a number of things with its noun.

    >>> count(1, "recording"), count(2, "other file")
    ('1 recording', '2 other files')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def cell(text: str) -> str:
    """Return a text of foreign origin as a safe cell of a CSV file.

    A spreadsheet evaluates a cell that begins with ``=``, ``+``, ``-`` or ``@`` as a formula; a leading apostrophe
    makes it text. Numbers remain numbers.

    >>> cell("=1+1"), cell("-3.5")
    ("'=1+1", '-3.5')
    """
    shown = visible(text)
    try:
        float(shown)
    except ValueError:
        return f"'{shown}" if shown.strip()[:1] in _FORMULA else shown
    return shown


_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠")
"""Characters with which a formula begins in a spreadsheet."""


def pretty(estimate: Estimate | None, *, brackets: bool = False) -> str:
    """Return an estimate for the page, with u after ± or in brackets.

    >>> pretty(Estimate(-8.36e-5, 9.6e-7, "m"))
    '(−8.360 ± 0.096) × 10⁻⁵ m'
    """
    if estimate is None:
        return "–"
    tail = " (95 %)" if isinstance(estimate, UpperLimit) else ""
    return f"{typeset(estimate.written(brackets=brackets))} {page_unit(estimate.unit)}".rstrip() + tail


def pretty_number(value: float | None, digits: int = 2) -> str:
    """Typeset a number without an uncertainty to a few digits; return a dash for None or NaN.

    >>> pretty_number(498765.0, 3)
    '4.99 × 10⁵'
    """
    if value is None or value != value:
        return "–"
    return typeset(f"{value:#.{digits}g}".rstrip("."))


def prefixed(estimate: Estimate) -> Estimate:
    """Return an estimate with an SI prefix that gives a value of about 1 to 1000; most units have no prefixes.

    >>> prefixed(Estimate(0.05145, 2e-5, "m"))
    51.450(20) mm
    """
    size = max(abs(estimate.value), estimate.u if math.isfinite(estimate.u) else 0.0)
    for below, factor, unit in _UNITS[estimate.unit].prefixes if estimate.unit in _UNITS else ():
        if 0.0 < size < below:
            value, u = (float(f"{x * factor:.15g}") for x in (estimate.value, estimate.u))
            return type(estimate)(value, u, unit)
    return estimate


def page_unit(unit: str) -> str:
    """Return a unit as the page writes it.

    >>> page_unit("1/(m s)"), page_unit("rad/s^2"), page_unit("m^(1-n)/s"), page_unit("(m/s^2)^(1-n)/s")
    ('m⁻¹ s⁻¹', 'rad/s²', 'm¹⁻ⁿ/s', '(m/s²)¹⁻ⁿ/s')
    """
    if unit in _UNITS and (page := _UNITS[unit].page) is not None:
        return page
    return _POWER.sub(lambda power: (power[1] or power[2]).translate(_SUPERSCRIPT), unit)


def rejection_of(fit: LawFit) -> str:
    """Return that a law is rejected, and why."""
    reasons = {
        "misfit": f"chi-square above {pretty_number(fit.limit, 3)}",
        "negative": "negative coefficient",
        "beaten": f"worse than {fit.beaten_by}",
        "differ": "coefficients differ",
    }
    return f"rejected: {reasons[fit.rejection]}"


def law_status(damping: Damping | JointDamping, name: str) -> str:
    """Return the status of a law of one run or of several in a few words, and why it is rejected."""
    fit = damping.fits[name]
    if name == damping.selected:
        if isinstance(damping, Damping) and damping.by_statement:
            return f"stated, and {rejection_of(fit)}" if fit.rejected else "stated"
        return f"{rejection_of(fit)}, yet the least bad" if fit.rejected else "selected"
    if fit.rejected:
        return rejection_of(fit)
    possible = damping.possible if isinstance(damping, Damping) else damping.admissible
    return "admissible" if name in possible else "unlikely"


def cells(estimate: Estimate | None) -> str:
    """Return an estimate as value, u and unit for three cells of a spreadsheet, with the digits of u, divided by |.

    >>> cells(Estimate(0.7525961, 4.96e-5, "s")), cells(Estimate(101325.0, 1490.0, "Pa"))
    ('0.752596|0.000050|s', '1.013e+05|0.015e+05|Pa')
    """
    if estimate is None:
        return "||"
    if isinstance(estimate, UpperLimit):
        return f"{estimate.written()}||{page_unit(estimate.unit)}"
    value, _, u = estimate.written().partition(" +- ")
    u, _, power = u.partition(")")
    return f"{value.lstrip('(')}{power}|{u}{power}|{page_unit(estimate.unit)}"


LETTERS = {"A0": "A₀", "gamma": "γ", "beta": "β", "mu": "μ"}


def unbroken(text: str) -> str:
    """Let no line break in a text."""
    return text.replace(" ", "\u00a0")


def equation(name: str, estimate: Estimate) -> str:
    """Write a parameter with its value or its upper limit.

    >>> equation("beta", Estimate(0.235, 0.012, "1/(m s)")), equation("mu", UpperLimit(1e-5, 2e-5, "m/s"))
    ('β = 0.235 ± 0.012 m⁻¹ s⁻¹', 'μ < 4.7 × 10⁻⁵ m/s (95 %)')
    """
    sign = "" if isinstance(estimate, UpperLimit) else "= "
    return f"{LETTERS.get(name, name)} {sign}{pretty(estimate)}"


_SUBSTITUTES = (
    (re.compile(r"(?<=[\d)] )(1/\(m s\)|1/s|m/s\^2|degC)(?!\w)"), lambda found: page_unit(found[1])),
    (re.compile(r"(?<=[\d)])e([+-]\d+)\b"), lambda found: f" × 10{str(int(found[1])).translate(_SUPERSCRIPT)}"),
    (re.compile(r"\+-"), "±"),
    (re.compile(r"(?<![\w.+-])-(?=\d)"), "−"),
    (re.compile(r"\b(gamma|beta|mu)(?= = )"), lambda found: LETTERS[found[1]]),
    (re.compile(r"(?<=\d),(?=\d{3}(?!\d))"), "\u202f"),
    (re.compile(r"(?<=\d)%"), "\u00a0%"),
    (re.compile(r"\bchi-square\b"), "χ²"),
)


def typeset(message: str) -> str:
    """Return a message with numbers and units typeset as in the page's tables.

    >>> typeset("gamma = (6.50 +- 0.12)e-03 1/s; left in, the amplitude changes by -0.4 mm (2.0%)")
    'γ = (6.50 ± 0.12) × 10⁻³ s⁻¹; left in, the amplitude changes by −0.4 mm (2.0\xa0%)'
    """
    for pattern, by in _SUBSTITUTES:
        message = pattern.sub(by, message)
    return message


_TEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: "\\" + character for character in "&%$#_{}"},
}
_TEX_MATH = {
    **dict(zip("±−×·≤≥≈∞", (r"\pm", "-", r"\times", r"\cdot", r"\leq", r"\geq", r"\approx", r"\infty"), strict=True)),
    "χ²": r"\chi^2",
    "φ": r"\varphi",
    "λ": r"\lambda",  # Unicode spells its name without the b
    **{letter: "\\" + unicodedata.name(letter).split()[-1].lower() for letter in "αβγδζηθκμνπρστψω"},
    **{letter: "\\" + unicodedata.name(letter).split()[-1].capitalize() for letter in "ΔΩ"},
    **{lowered: f"_{digit}" for digit, lowered in enumerate("₀₁₂₃₄₅₆₇₈₉")},
}
_SUPERSCRIPTS = {raised: plain for plain, raised in _RAISED.items()}


def tex_words(text: str) -> str:
    """Convert a sentence of the page to LaTeX, with symbols and powers as mathematics."""
    text = (
        tex_text(text)
        .replace(r"\_", r"\_\allowbreak{}")
        .replace("\u00a0", "~")
        .replace("\u202f", r"\,")
        .replace("“", "``")
        .replace("”", "''")
    )
    text = re.sub(
        f"[{''.join(_SUPERSCRIPTS)}]+", lambda run: f"$^{{{''.join(_SUPERSCRIPTS[each] for each in run[0])}}}$", text
    )
    # A letter before an equals sign or in u(k) is a symbol, and so is every single u.
    text = re.sub(r"(?<![\w\\$])([A-Za-z])(?=[₀-₉]?[~ ][=<])|\b([uU]\([A-Za-z]\))|\b(u)\b", r"$\1\2\3$", text)
    for symbol, tex in _TEX_MATH.items():
        text = text.replace(symbol, f"${tex}$")
    return text.replace("°C", r"\textcelsius{}").replace("µ", r"\textmu{}").replace("–", "--")


def tex_quantity(estimate: Estimate | None) -> str:
    """Write value(u)unit for siunitx, with two digits of u."""
    if estimate is None:
        return "--"
    if isinstance(estimate, UpperLimit):
        return f"$<$ {tex_number(estimate.written()[2:], estimate.unit)} (\\qty{{95}}{{\\percent}})"
    match = re.fullmatch(r"(-?[\d.]+)(\([\d.]+\))?(?:e([+-]\d+))?", estimate.written(brackets=True))
    if match is None:
        return "--"
    # siunitx wants the u in the last digit: 13.9(12) for 13.9(1.2).
    power = f"e{int(match[3])}" if match[3] else ""
    return tex_number(f"{match[1]}{(match[2] or '').replace('.', '')}{power}", estimate.unit)


def tex_number(number: str, unit: str) -> str:
    """Write a number, possibly with its uncertainty, and its unit for siunitx."""
    if not unit:
        return rf"\num{{{number}}}"
    macro = _UNITS[unit].tex if unit in _UNITS else rf"\text{{{tex_text(unit)}}}"
    return rf"\qty{{{number}}}{{{macro}}}"


def tex_text(text: str) -> str:
    """Return a text of foreign origin for LaTeX."""
    return "".join(_TEX_SPECIAL.get(character, character) for character in visible(text))
