"""Fifty tables of a laboratory, a school and an office that are no recordings of an oscillation."""

from __future__ import annotations

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


def _grade(_: int) -> str:
    return _RNG.choice("ABCDEF")


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
    "L and T": _table("L (m),T (s)", 6, _rising(0.2, 0.1), _law(_period)),
    "L and T in cm": _table("L/cm;T/s", 8, _rising(20, 10, 0), _law(_period), mark=";"),
    "length and ten periods": _table(
        "length (cm),time of 10 periods (s)", 7, _rising(20, 10, 0), _law(lambda i: 10 * _period(i))
    ),
    "Länge und Periode": _table(
        "Länge (m);Periode (s)", 9, _number(0.2, 1, 2, True), _number(0.9, 2, 2, True), mark=";"
    ),
    "longitud y periodo": _table("Longitud (m)\tPeriodo (s)", 10, _rising(0.1, 0.1), _law(_period), mark="\t"),
    "lunghezza e periodo": _table("lunghezza,periodo,errore", 12, _rising(0.1, 0.1), _law(_period), lambda _: 0.01),
    "mass and period": _table(
        "mass (kg),period (s)", 6, _rising(0.05, 0.05), _law(lambda i: 1.7 * (0.05 + 0.05 * i) ** 0.5)
    ),
    "mass and T squared": _table("m (g),T^2 (s^2)", 8, _rising(50, 50, 0), _law(lambda i: 0.14 * (i + 1))),
    "angle and period": _table("angle (deg),period (s)", 9, _rising(5, 10, 0), _law(lambda i: 2.0 + 0.01 * i * i)),
    "five trials": _table("trial,period (s)", 5, _count, _number(0.78, 0.8)),
    "ten trials of five lengths": _table("length (m),T1,T2,T3,T4,T5", 5, _rising(0.2, 0.2), *[_law(_period)] * 5),
    "spring extension": _table("mass (g),extension (cm)", 8, _rising(0, 50, 0), _law(lambda i: 3.4 * i)),
    "Hooke": _table("F (N),x (m)", 10, _rising(0, 0.5), _law(lambda i: 0.036 * i)),
    "spring constants": _table("spring,k (N/m),u(k) (N/m)", 6, _count, _number(10, 20), _number(0.1, 0.3)),
    "resonance curve": _table(
        "frequency (Hz),amplitude (mm)", 15, _rising(1, 0.05), _law(lambda i: 5 / (0.1 + abs(i - 6)))
    ),
    "damping and mass": _table("disc,mass (g),gamma (1/s)", 7, _count, _rising(20, 10, 0), _number(0.005, 0.02, 4)),
    "quality factors": _table("run,Q,u(Q)", 12, _count, _number(100, 400, 0), _number(1, 9, 0)),
    "ruler calibration": _table("ruler (cm),sensor (cm)", 9, _rising(10, 5, 0), _law(lambda i: 10.1 + 5.02 * i)),
    "sensor calibration": _table("distance (cm),voltage (V)", 12, _rising(10, 5, 0), _law(lambda i: 9 / (1 + i))),
    "thermistor": _table("temperature (C),resistance (ohm)", 14, _rising(0, 5, 0), _law(lambda i: 1e4 * 0.8**i, 0)),
    "resistors": _table("no,nominal (ohm),measured (ohm)", 60, _count, lambda i: 10 * (i + 1), _number(9, 620)),
    "capacitors": _table(
        "part;C (nF);tan delta", 30, _count, _number(1, 100, 1, True), _number(0, 0.1, 3, True), mark=";"
    ),
    "diode": _table("U_F (V),I_F (mA)", 16, _rising(0, 0.05), _law(lambda i: 2.0 ** (i - 8))),
    "refraction": _table("angle in (deg),angle out (deg)", 9, _rising(0, 10, 0), _law(lambda i: 6.5 * i, 1)),
    "lens": _table("object (cm),image (cm),magnification", 8, _rising(15, 5, 0), _number(10, 60, 1), _number(0.2, 3)),
    "specific heat": _table("sample,mass (g),heat (J)", 6, _count, _number(50, 200, 0), _number(100, 900, 0)),
    "densities": _table("material,density (g/cm3)", 10, _name, _number(0.7, 19)),
    "dice": _table("throw,eyes", 100, _count, lambda _: _RNG.randint(1, 6)),
    "counts": _table("channel,counts", 256, _count, lambda _: _RNG.randint(0, 99)),
    "absorption spectrum": _table(
        "wavelength (nm),absorbance", 301, _rising(400, 1, 0), _law(lambda i: 0.5 + 0.001 * i)
    ),
    "emission spectrum": _table("wavelength (nm)\tintensity", 400, _rising(350, 1, 0), _number(0, 4000, 0), mark="\t"),
    "Raman": _table("wavenumber (1/cm),counts", 500, _rising(200, 2, 0), _number(100, 900, 0)),
    "diffraction": _table("2theta,counts", 600, _rising(10, 0.1, 1), _number(10, 900, 0)),
    "gradebook": _table("student,lab 1,lab 2,lab 3,exam", 24, _name, _mark, _mark, _mark, _mark),
    "gradebook of letters": _table("name,grade,points", 30, _name, _grade, _mark),
    "class list": _table("number;name;group", 25, _count, _name, lambda i: i % 4 + 1, mark=";"),
    "class list with ids": _table("last,first,id", 120, _name, _name, lambda i: 400_000 + 37 * i),
    "attendance": _table(
        "student," + ",".join(f"week {i}" for i in range(1, 9)), 22, _name, *[lambda _: _RNG.randint(0, 1)] * 8
    ),
    "marks alone": _table("points", 40, _mark),
    "price list": _table("article,price (EUR)", 80, lambda i: f"A-{1000 + i}", _number(1, 90)),
    "Preisliste": _table("Artikel;Preis;Anzahl", 50, lambda i: f"Teil {i}", _number(1, 90, 2, True), _mark, mark=";"),
    "inventory": _table("shelf,item,quantity", 35, _count, _name, _mark),
    "survey": _table("id,age,answer", 90, _count, lambda _: _RNG.randint(17, 30), lambda _: _RNG.randint(1, 5)),
    "parameters": "parameter,value\nmass,0.05\nlength,0.98\nrate,100\nseconds,120\n",
    "parameters of runs": _table(
        "run,mass (kg),constant (N/m),disc (mm)", 18, _count, _number(0.05, 0.1), _number(12, 15), _number(40, 90, 0)
    ),
    "parameter lines": "mass = 0.05 kg\nconstant = 14 N/m\ndisplacement = 0.05 m\n",
    "fit results": "name;value;error\nA;0.052;0.001\ngamma;0.015;0.001\nomega;7.95;0.01\nphi;0.1;0.02\n",
    "multiplication table": _table("", 12, *[lambda i, k=k: (i + 1) * k for k in range(1, 11)]),  # type: ignore[misc]
    "population": _table(
        "country,population,area (km2)", 45, _name, lambda _: _RNG.randint(10**5, 10**8), _number(10**3, 10**6, 0)
    ),
}
"""Their texts, by what they are."""
