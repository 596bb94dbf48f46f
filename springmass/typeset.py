"""How numbers, units and the standing of a law are written, on a page and in a table."""

from __future__ import annotations

import math
import re

from acquisition.errors import visible
from pipeline.damping.select import Damping
from pipeline.numerics.estimate import Estimate, UpperLimit, format_limit, format_value

_PAGE_UNITS = {"1": "", "degC": "°C", "m/s^2": "m/s²", "1/s": "s⁻¹", "1/(m s)": "m⁻¹ s⁻¹"}
_SUPERSCRIPT = str.maketrans("-0123456789n", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ")
_POWER = re.compile(r"\^(?:\(([\dn-]+)\)|([\dn-]+))")
NOTHING = "-"


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


def pretty(estimate: Estimate | None) -> str:
    """Return an estimate for the page: the digits of :func:`pipeline.numerics.estimate.format_value`, typeset.

    >>> pretty(Estimate(-8.36e-5, 9.6e-7, "m"))
    '(−8.360 ± 0.096) × 10⁻⁵ m'
    """
    if estimate is None:
        return "–"
    if isinstance(estimate, UpperLimit):
        return f"< {_typeset(format_limit(estimate.limit))} {page_unit(estimate.unit)}".rstrip() + " (95 %)"
    number = format_value(estimate.value, estimate.u)
    return f"{_typeset(number)} {page_unit(estimate.unit)}".rstrip()


def pretty_number(value: float | None, digits: int = 2) -> str:
    """Typeset a number without an uncertainty to a few digits; return a dash for None or NaN.

    >>> pretty_number(498765.0, 3)
    '4.99 × 10⁵'
    """
    if value is None or value != value:
        return "–"
    return _typeset(f"{value:#.{digits}g}".rstrip("."))


# For each unit: (upper limit of the value, factor, unit with its prefix), the smallest limit first. Periods stay in
# seconds down to 0.1 s.
_PREFIXES = {
    "m": ((1e-3, 1e6, "µm"), (1.0, 1e3, "mm")),
    "kg": ((1e-3, 1e6, "mg"), (1.0, 1e3, "g")),
    "s": ((1e-3, 1e6, "µs"), (0.1, 1e3, "ms")),
    "m/s": ((1e-4, 1e6, "µm/s"), (0.1, 1e3, "mm/s")),
}


def prefixed(estimate: Estimate) -> Estimate:
    """Return an estimate with an SI prefix that gives a value of about 1 to 1000; most units have no prefixes.

    >>> prefixed(Estimate(0.05145, 2e-5, "m"))
    51.450(20) mm
    """
    size = max(abs(estimate.value), estimate.u if math.isfinite(estimate.u) else 0.0)
    for below, factor, unit in _PREFIXES.get(estimate.unit, ()):
        if 0.0 < size < below:
            value, u = (float(f"{x * factor:.15g}") for x in (estimate.value, estimate.u))
            return type(estimate)(value, u, unit)
    return estimate


def page_unit(unit: str) -> str:
    """Return a unit as the page writes it.

    >>> page_unit("1/(m s)"), page_unit("rad/s^2"), page_unit("m^(1-n)/s"), page_unit("(m/s^2)^(1-n)/s")
    ('m⁻¹ s⁻¹', 'rad/s²', 'm¹⁻ⁿ/s', '(m/s²)¹⁻ⁿ/s')
    """
    if unit in _PAGE_UNITS:
        return _PAGE_UNITS[unit]
    return _POWER.sub(lambda power: (power[1] or power[2]).translate(_SUPERSCRIPT), unit)


def law_status(damping: Damping, name: str) -> str:
    """Return the status of a law in a few words."""
    if name == damping.selected:
        if damping.by_statement:
            return "stated, and rejected" if damping.fits[name].rejected else "stated"
        return "rejected, yet the least bad" if damping.fits[name].rejected else "selected"
    if damping.fits[name].rejected:
        return "rejected"
    return "admissible" if name in damping.admissible else "unlikely"


def _typeset(number: str) -> str:
    mantissa, mark, power = number.replace("+-", "±").partition("e")
    mantissa = mantissa.replace("-", "−")
    return f"{mantissa} × 10{_superscript(int(power))}" if mark else mantissa


def _superscript(power: int) -> str:
    return str(power).translate(_SUPERSCRIPT)


def cells(estimate: Estimate | None) -> str:
    """Return an estimate as value, u and unit for three cells of a spreadsheet, with the digits of u, divided by |.

    >>> cells(Estimate(0.7525961, 4.96e-5, "s")), cells(Estimate(101325.0, 1490.0, "Pa"))
    ('0.752596|0.000050|s', '1.013e+05|0.015e+05|Pa')
    """
    if estimate is None:
        return "||"
    if isinstance(estimate, UpperLimit):
        return f"< {format_limit(estimate.limit)}||{page_unit(estimate.unit)}"
    value, _, u = format_value(estimate.value, estimate.u).partition(" +- ")
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
    (re.compile(r"(?<=[\d)])e([+-]\d+)\b"), lambda found: f" × 10{_superscript(int(found[1]))}"),
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
