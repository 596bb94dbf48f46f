"""Tables of a laboratory, a school and an office that are no recordings of an oscillation."""

import random
from collections.abc import Callable

_RNG = random.Random(54)
_NAMES = ("Ana", "Ben", "Carla", "Deniz", "Elif", "Finn", "Greta", "Hugo", "Ines", "Jonas")


def _table(heading: str, rows: int, *cells: Callable[[int], object], mark: str = ",") -> str:
    lines = [mark.join(str(cell(i)) for cell in cells) for i in range(rows)]
    return "\n".join([*([heading] if heading else []), *lines, ""])


def _name(i: int) -> str:
    return f"{_NAMES[i % 10]} {chr(65 + i // 10)}."


def _mark(_: int) -> int:
    return _RNG.randint(1, 15)


def _number(low: float, high: float, digits: int = 2, comma: bool = False) -> Callable[[int], str]:
    def cell(_: int) -> str:
        text = f"{_RNG.uniform(low, high):.{digits}f}"
        return text.replace(".", ",") if comma else text

    return cell


def _rising(start: float, step: float, digits: int = 2) -> Callable[[int], str]:
    return lambda i: f"{start + i * step:.{digits}f}"


def _law(function: Callable[[int], float], digits: int = 3) -> Callable[[int], str]:
    return lambda i: f"{function(i) + _RNG.gauss(0.0, 0.002):.{digits}f}"


def _count(i: int) -> int:
    return i + 1


def _period(i: int) -> float:
    return 2.006 * (0.2 + 0.1 * i) ** 0.5


TABLES: dict[str, str] = {
    "length and period": _table("length (m),period (s)", 6, _rising(0.2, 0.1), _law(_period)),
    "length and ten periods": _table(
        "length (cm),time of 10 periods (s)", 7, _rising(20, 10, 0), _law(lambda i: 10 * _period(i))
    ),
    "Länge und Periode": _table(
        "Länge (m);Periode (s)", 9, _number(0.2, 1, 2, True), _number(0.9, 2, 2, True), mark=";"
    ),
    "longitud y periodo": _table("Longitud (m)\tPeriodo (s)", 10, _rising(0.1, 0.1), _law(_period), mark="\t"),
    "five trials": _table("trial,period (s)", 5, _count, _number(0.78, 0.8)),
    "spring extension": _table("mass (g),extension (cm)", 8, _rising(0, 50, 0), _law(lambda i: 3.4 * i)),
    "resonance curve": _table(
        "frequency (Hz),amplitude (mm)", 15, _rising(1, 0.05), _law(lambda i: 5 / (0.1 + abs(i - 6)))
    ),
    "capacitors": _table(
        "part;C (nF);tan delta", 30, _count, _number(1, 100, 1, True), _number(0, 0.1, 3, True), mark=";"
    ),
    "dice": _table("throw,eyes", 100, _count, lambda _: _RNG.randint(1, 6)),
    "emission spectrum": _table("wavelength (nm)\tintensity", 400, _rising(350, 1, 0), _number(0, 4000, 0), mark="\t"),
    "gradebook": _table("student,lab 1,lab 2,lab 3,exam", 24, _name, _mark, _mark, _mark, _mark),
    "attendance": _table(
        "student," + ",".join(f"week {i}" for i in range(1, 9)), 22, _name, *[lambda _: _RNG.randint(0, 1)] * 8
    ),
    "Preisliste": _table("Artikel;Preis;Anzahl", 50, lambda i: f"Teil {i}", _number(1, 90, 2, True), _mark, mark=";"),
    "parameters": "parameter,value\nmass,0.05\nlength,0.98\nrate,100\nseconds,120\n",
    "fit results": "name;value;error\nA;0.052;0.001\ngamma;0.015;0.001\nomega;7.95;0.01\nphi;0.1;0.02\n",
    "multiplication table": _table("", 12, *[lambda i, k=k: (i + 1) * k for k in range(1, 11)]),  # type: ignore[misc]
}
"""Their texts, by what they are."""
