"""Ask about the bench at the terminal: masses and disc diameter, each with unit and uncertainty."""

from __future__ import annotations

import re
import sys

from acquisition.errors import visible
from pipeline.bench.scene import Scene
from springmass.errors import USAGE, ProgramError

__all__ = ["ask_for_bench", "quantity_of"]

_MASS = {"kg": 1.0, "g": 1e-3}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_QUESTIONS = (
    (
        ("bob", "mass_kg"),
        "bob_mass_kg",
        "Mass of all that hangs on the spring",
        "kg",
        _MASS,
        "0.2007 or 200.7 g +- 0.1",
    ),
    (("spring", "mass_kg"), "spring_mass_kg", "Mass of the spring", "kg", _MASS, "0.0104 or 10.4 g +- 0.1"),
    (("disc", "diameter_m"), "disc_diameter_m", "Diameter of the disc", "m", _LENGTH, "0.102 or 102 mm +- 0.5"),
)
_ANSWER = re.compile(
    r"(?P<value>[-+]?[\d.,]+(?:e[-+]?\d+)?)\s*(?P<unit>[a-z]*)(?:\s*(?:\+-|±)\s*(?P<u>[\d.,]+)\s*(?P<unit_u>[a-z]*))?"
)


def ask_for_bench(scene: Scene, name: str) -> dict[tuple[str, str], dict[str, float]]:
    """Ask on stderr for values missing from a scene, and return the answers by table and key of the scene.

    Parameters
    ----------
    scene : Scene
        Values that are already known.
    name : str
        Name of the recording.

    Raises
    ------
    ProgramError
        With exit code 2 if standard input ends before the last answer.
    """
    answers: dict[tuple[str, str], dict[str, float]] = {}
    for place, field, words, unit, units, example in _QUESTIONS:
        if getattr(scene, field) is not None:
            continue
        while True:
            print(
                f"{visible(name)}: {words} / {unit} ({example}; Enter if unknown): ",
                end="",
                file=sys.stderr,
                flush=True,
            )
            line = sys.stdin.readline() if sys.stdin is not None else ""
            if not line:
                raise ProgramError("--ask needs answers, and standard input has ended; give --mass-kg instead", USAGE)
            if not line.strip():
                break
            try:
                value, u = quantity_of(line, units)
            except ValueError as error:
                print(f"{error}", file=sys.stderr)
                continue
            answers[place] = {"value": value, "u": u}
            break
    return answers


def quantity_of(text: str, units: dict[str, float]) -> tuple[float, float]:
    """Return value and standard uncertainty of a typed quantity, in SI units.

    If no unit was typed, the first of ``units`` applies.

    Raises
    ------
    ValueError
        If the text is not a positive number with one of the units.

    Examples
    --------
    >>> quantity_of("200.7 g +- 0.1", {"kg": 1.0, "g": 1e-3})
    (0.2007, 0.0001)
    """
    found = _ANSWER.fullmatch(text.strip().lower())
    unit = (found["unit"] or next(iter(units))) if found else ""
    unit_u = (found["unit_u"] or unit) if found else ""
    if found is None or unit not in units or unit_u not in units:
        raise ValueError(f"give a number and a unit, {' or '.join(units)}, got {visible(text.strip())!r}")
    try:
        value, u = (float(each.replace(",", ".")) for each in (found["value"], found["u"] or "0"))
    except ValueError:
        raise ValueError(f"give a number, got {visible(text.strip())!r}") from None
    if not value > 0.0:
        raise ValueError(f"give a positive number, got {visible(text.strip())!r}")
    return float(f"{value * units[unit]:.12g}"), float(f"{u * units[unit_u]:.12g}")
