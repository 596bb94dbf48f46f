"""The frozen outputs: how they are written, read and compared.

A file below ``values`` has the command lines of one group. A line ``$ ...`` is a command line, and below it stands one
line for each value, sorted: ``quantity = 0.7900665 ± 0.0000228 s``, a count, a text or a number without uncertainty. A
value may move by a hundredth of its u and a u by a hundredth of itself; a number without u by a hundred thousandth, a
share or a weight by 0.02, and a number in units of u by a hundredth; counts and texts are exact. Values are written to
a thousandth of u.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.golden.commands import Table, Value

VALUES = Path(__file__).resolve().parent / "values"
OF_U, RELATIVE, OF_SHARE = 0.01, 1e-5, 0.02
ABSENT = "absent"

Goldens = dict[str, Table]
"""Tables by command line."""


@dataclass(frozen=True, slots=True)
class Move:
    """A value that differs from the frozen one by more than its tolerance."""

    command: str
    quantity: str
    before: str
    after: str
    of_u: float | None  # move in units of u; None if it is no such number
    of_itself: float | None  # relative move of u, or of a number without u

    def __str__(self) -> str:
        """Return the row of the table of moves without its command line."""
        shift = "" if self.of_u is None else f"  {self.of_u:+.3g} u"
        shift += "" if self.of_itself is None else f"  {100.0 * self.of_itself:+.3g} %"
        return f"  {self.quantity}: {self.before} -> {self.after}{shift}"


def parsed(text: str) -> Goldens:
    """Return the goldens of one file's text."""
    goldens: Goldens = {}
    table: Table = {}
    for line in text.splitlines():
        if line.startswith("$ "):
            table = goldens[line[2:]] = {}
        elif line:
            quantity, _, value = line.partition(" = ")
            table[quantity] = _value(value)
    return goldens


def written(goldens: Goldens) -> str:
    """Return the text of one file."""
    return "\n".join(f"$ {command}\n{_lines(table)}" for command, table in sorted(goldens.items()))


def _lines(table: Table) -> str:
    return "".join(f"{quantity} = {text(value)}\n" for quantity, value in sorted(table.items()))


def text(value: Value) -> str:
    """Return a value as it is written: a thousandth of u is its last digit."""
    if isinstance(value, tuple):
        number, u, unit = value
        if not (math.isfinite(number) and math.isfinite(u) and u > 0.0):
            return f"{number:.10g} ± {u:g} {unit}".rstrip()
        decimals = max(0, 3 - math.floor(math.log10(u)))
        return f"{number:.{decimals}f} ± {u:.4g} {unit}".rstrip()
    if isinstance(value, float):
        short = f"{value:.7g}"
        return short if re.search(r"[.einf]", short) else f"{short}.0"
    return " ".join(str(value).split())


_NUMBER = r"[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|inf|nan)"


def _value(text: str) -> Value:
    if match := re.fullmatch(rf"({_NUMBER}) ± ({_NUMBER})(?: (.*))?", text):
        return float(match[1]), float(match[2]), match[3] or ""
    if re.fullmatch(r"[-+]?\d+", text):
        return int(text)
    return float(text) if re.fullmatch(_NUMBER, text) else text


def moves(command: str, before: Table, after: Table) -> Iterator[Move]:
    """Yield what differs by more than its tolerance."""
    for quantity in sorted({*before, *after}):
        a, b = before.get(quantity, ABSENT), after.get(quantity, ABSENT)
        if quantity.startswith("budget.") and ABSENT in (a, b):
            unlisted = 2.0 if quantity.endswith("coverage_factor") else 0.0
            a, b = (unlisted if each == ABSENT else each for each in (a, b))
        of_u, of_itself, moved = _difference(quantity, a, b)
        if moved:
            yield Move(command, quantity, text(a), text(b), of_u, of_itself)


def _difference(quantity: str, a: Value, b: Value) -> tuple[float | None, float | None, bool]:
    """Return the move in u, the relative move of u or of a bare number, and whether one exceeds its tolerance."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        if a[2] != b[2] or not all(map(math.isfinite, (*a[:2], *b[:2]))) or a[1] <= 0.0:
            return None, None, text(a) != text(b)
        of_u, of_itself = (b[0] - a[0]) / a[1], b[1] / a[1] - 1.0
        return of_u, of_itself, abs(of_u) > OF_U or abs(of_itself) > OF_U
    numbers = isinstance(a, (int, float)) and isinstance(b, (int, float))
    if not numbers or not (isinstance(a, float) or isinstance(b, float)) or not (math.isfinite(a) and math.isfinite(b)):
        return None, None, text(a) != text(b)
    of_itself = (b - a) / abs(a) if a else math.inf
    if re.search(r"budget\.|weights", quantity):
        return None, of_itself, abs(b - a) > OF_SHARE
    if re.search(r"pull|chi2|bic|deviation|error_over_bound|snr", quantity):
        return None, of_itself, abs(b - a) > OF_U * max(1.0, abs(a))
    if quantity.endswith("error"):
        # The smallest errors of an integrator are rounding, which differs among machines.
        return None, of_itself, abs(b - a) > max(OF_U * abs(a), 1e-9)
    tolerance = OF_U if re.search(r"(?:^|[._ ])u(?:_\w+)?$|_u$", quantity) else RELATIVE
    return None, of_itself, a != b and abs(b - a) > tolerance * abs(a)
