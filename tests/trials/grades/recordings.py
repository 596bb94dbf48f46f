"""The real recordings: which values of 0.3.0 that were sound stay sound.

The command lines are those of the goldens. A mass is stated, so that a recording of distances gives a spring constant.
``released.txt`` has what 0.3.0 calls sound, one recording a line.
"""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import springmass
from tests.golden.inputs import RECORDINGS
from tests.trials.grades.graded import Said, said_of

RELEASED = Path(__file__).with_name("released.txt")
STAY = 0.95  # share of the values that stay sound
JUDGED = {"period": "T", "amplitude": "A0", "spring_constant": "k"}
SCENE = {"bob": {"mass_kg": {"value": 0.2, "u": 1e-4}}, "spring": {"mass_kg": {"value": 0.01, "u": 2e-4}}}


def said_of_command(line: str) -> Said:
    """Return what the program says of the recording of a command line; nothing if it refuses it."""
    _, path, *words = shlex.split(line)
    how: dict[str, Any] = {}
    for word in words:
        if "=" in word:
            key, _, value = word.partition("=")
            how[key[2:].replace("-", "_")] = float(value) if key == "--rate-hz" else value
    try:
        return said_of(springmass.analyse(path.replace("{recordings}", str(RECORDINGS)), SCENE, **how).analysis)
    except springmass.Error:
        return Said()


def sound_of(said: Said) -> list[str]:
    """Return the symbols of the judged values that are sound."""
    return [symbol for name, symbol in JUDGED.items() if name in said.values and said.values[name].sound]


def released() -> dict[str, list[str]]:
    """Return the symbols that were sound by command line."""
    lines = RELEASED.read_text("utf-8").splitlines()
    return {line: symbols.split() for symbols, _, line in (each.partition(" | ") for each in lines)}


def lost() -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield each symbol that is no longer sound, its command line, and the warnings there."""
    for line, symbols in released().items():
        if symbols:
            said = said_of_command(line)
            for symbol in symbols:
                if symbol not in sound_of(said):
                    yield symbol, line, said.warnings
