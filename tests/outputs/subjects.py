"""What the suite plays: recordings by other people, troubles, the bundled recordings, and motions of other kinds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import springmass as sm
from acquisition.errors import AcquisitionError, NeedsAnswer
from acquisition.recordings.questions import Missing
from springmass import load, sample_data
from tests.trials.troubles.kinds import KINDS
from tests.trials.troubles.record import Kind

__all__ = ["CLASSES", "RECORDINGS", "Subject", "recordings", "samples", "specials", "troubles"]

F8 = NDArray[np.float64]
RECORDINGS = Path(__file__).resolve().parents[2].parent / "shared" / "recordings"


@dataclass(frozen=True)
class Subject:
    """A file and what is said of it.

    Parameters
    ----------
    name : str
    path : Path
    answers : mapping of str to str or float
        Keyword arguments of :func:`springmass.load`.
    scene : mapping
        Tables of a scene file; empty where there is none.
    laws : tuple
        Damping laws of the user's own, for Python alone.
    """

    name: str
    path: Path
    answers: Mapping[str, str | float] = field(default_factory=dict)
    scene: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    laws: tuple[Any, ...] = ()

    @property
    def options(self) -> list[str]:
        """The answers as options of a command."""
        return [
            word
            for name, value in self.answers.items()
            for word in (f"--{name.replace('_', '-')}", f"{value:g}" if isinstance(value, float) else value)
        ]


def recordings(*, every: bool) -> Iterator[Subject]:
    """Yield the real recordings: by every run and channel that their questions list, or by the examples alone."""
    for path in sorted(RECORDINGS.rglob("*")):
        if path.is_file() and path.name != "ORIGIN.md":
            for answers in _answers(path, {}, every=every):
                given = " ".join(str(value) for value in answers.values())
                yield Subject(f"{path.relative_to(RECORDINGS).as_posix()} {given}".strip(), path, answers)


def _answers(path: Path, given: dict[str, str | float], *, every: bool) -> Iterator[dict[str, str | float]]:
    """Answer the first question until the reader asks none; a file that is refused is a subject, too."""
    try:
        load(path, **given)
    except NeedsAnswer as error:
        need = error.question.needs[0]
        branches = every and need.what in (Missing.RUN, Missing.CHANNEL)
        for choice in need.choices if branches else (need.example,):
            yield from _answers(path, {**given, need.what.value: choice}, every=every)
        return
    except AcquisitionError:
        pass
    yield given


def samples() -> Iterator[Subject]:
    """Yield the bundled recordings with their scenes."""
    for path in sorted(sample_data().glob("*position*.txt")):
        scene = {"bob": {"mass_kg": {"value": 0.2, "u": 1e-4}}}
        yield Subject(path.name, path, scene=scene)


def troubles(folder: Path) -> Iterator[Subject]:
    """Yield one record of every kind of trouble, and of those without any."""
    for number, kind in enumerate(KINDS):
        yield _trouble(number, kind, folder)


def _trouble(number: int, kind: Kind, folder: Path) -> Subject:
    record = kind.make(0)
    path = folder / f"trouble{number}.{'txt' if record.text else 'csv'}"
    if record.text:
        path.write_bytes(record.text)
    else:
        _write(path, record.t, record.y, "distance (m)")
    return Subject(f"trouble: {kind.name}", path, scene=record.scene)


def specials(folder: Path) -> Iterator[Subject]:
    """Yield motions of other quantities and other kinds, one of each."""
    t = np.arange(3000) / 100.0
    for name, unit, amplitude in (
        ("angle", "rad", 0.3),
        ("angular velocity", "rad/s", 1.2),
        ("velocity", "m/s", 0.4),
        ("acceleration", "m/s2", 3.0),
        ("voltage", "V", 1.5),
        ("force", "N", 0.8),
    ):
        y = amplitude * np.exp(-0.02 * t) * np.cos(8.3 * t + 0.4)
        yield _made(folder, name, t, y + 0.004 * amplitude * _noise(t, 1), f"{name} ({unit})")
    swing = 0.3 + 0.05 * np.exp(-0.02 * t) * np.cos(8.3 * t) + 3e-4 * _noise(t, 2)
    bench = {"bob": {"mass_kg": {"value": 0.2, "u": 1e-4}}, "disc": {"diameter_m": {"value": 0.1, "u": 1e-3}}}
    bench |= {"air": {"temperature_c": {"value": 21.0, "u": 0.5}}}
    yield _made(folder, "whole bench", t, swing, scene=bench)
    yield _made(
        folder, "overdamped", t, 0.3 + 0.05 * (1.2 * np.exp(-0.9 * t) - 0.2 * np.exp(-5.4 * t)) + 3e-4 * _noise(t, 3)
    )
    yield _made(folder, "still", t, 0.3 + 3e-4 * _noise(t, 4))
    two = 0.3 + 0.03 * np.cos(6.1 * t) + 0.028 * np.cos(9.7 * t + 1.0) + 3e-4 * _noise(t, 5)
    yield _made(folder, "two modes", t, two)
    for name, coefficients in (
        ("law of one's own", {"d": (-1 / 2, -1)}),
        ("law with a coefficient n", {"n": (-1 / 2, -1)}),
    ):
        law = sm.make_law("three-halves", _three_halves, coefficients, _guess)
        yield _made(folder, name, t, swing, laws=(law,), scene=bench)


def _made(folder: Path, name: str, t: F8, y: F8, heading: str = "distance (m)", **more: Any) -> Subject:
    path = folder / f"{name.replace(' ', '_')}.csv"
    _write(path, t, y, heading)
    return Subject(name, path, **more)


def _three_halves(t: F8, start: float, d: float) -> F8:
    return start / (1.0 + d * math.sqrt(start) * t / 2.0) ** 2


def _guess(t: F8, amplitude: F8) -> tuple[float, float]:
    slope, level = np.polyfit(t, 1.0 / np.sqrt(amplitude), 1)
    return level**-2, 2.0 * slope


def _noise(t: F8, seed: int) -> F8:
    return np.random.default_rng(seed).standard_normal(t.size)


def _write(path: Path, t: F8, y: F8, heading: str) -> None:
    lines = [f"time (s),{heading}"]
    lines += [f"{a:.6f},{'' if math.isnan(b) else f'{b:.9g}'}" for a, b in zip(t.tolist(), y.tolist(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


CLASSES: Mapping[str, Callable[[Path], Iterator[Subject]]] = {
    "recording": lambda _: recordings(every=False),
    "sample": lambda _: samples(),
    "trouble": troubles,
    "special": specials,
}
