"""Scene files at and beyond the ends of what they may hold: an answer or one line of refusal, never a traceback."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from springmass import sample_data
from springmass.cli import main

FILES = 500 if os.environ.get("SPRINGMASS_TRIALS") else 40
SECONDS = 10
POSITION = "undamped_simulated_position.txt"
ANSWERS = {0, 1, 2, 5}  # done, failed with its reason, refused, rejected under --strict

# The reference page's ranges, written down again: least positive value, greatest value, whether a sign is allowed.
RANGES = {
    "bob": {"mass_kg": (1e-12, 1e6, False)},
    "spring": {
        "mass_kg": (1e-12, 1e6, False),
        "constant_n_per_m": (1e-12, 1e12, False),
        "cubic_n_per_m3": (1e-12, 1e18, True),
    },
    "disc": {"diameter_m": (1e-6, 1e3, False)},
    "air": {
        "temperature_c": (1e-3, 100.0, True),
        "pressure_pa": (1e-3, 1e7, False),
        "relative_humidity": (1e-9, 1.0, False),
    },
    "sensor": {"sigma_m": (1e-12, 1e3, False)},
    "start": {"displacement_m": (1e-9, 1e6, True), "velocity_m_per_s": (1e-9, 1e6, True)},
    "damping": {
        "gamma_per_s": (1e-12, 1e12, False),
        "beta_per_m_s": (1e-12, 1e12, False),
        "mu_m_per_s": (1e-12, 1e12, False),
    },
}
STRANGE = [
    "1e308",
    "-1e308",
    "5e-324",
    "nan",
    "inf",
    "1" + "0" * 400,
    "true",
    '"0.2"',
    "[1, 2]",
    "{}",
    "1979-05-27",
    "0x7fffffffffffffff",
]


@contextmanager
def answer_within(seconds: int) -> Iterator[None]:
    """Raise TimeoutError where the body takes longer."""

    def late(_: int, __: FrameType | None) -> None:
        raise TimeoutError(f"no answer within {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def scene_text(rng: np.random.Generator) -> str:
    """Return a random scene: values over all orders of magnitude that are allowed, some uncertain, some strange."""
    lines = []
    for table, keys in RANGES.items():
        lines.append(f"[{table}]")
        for key, (least, greatest, signed) in keys.items():
            if rng.random() < 0.4 and (table, key) not in {("bob", "mass_kg"), ("spring", "constant_n_per_m")}:
                continue
            size = least * (greatest / least) ** rng.choice([0.0, 1.0, rng.random(), 0.5])
            number = f"{size * (rng.choice([-1, 1]) if signed else 1):.17g}"
            if rng.random() < 0.02:
                number = str(rng.choice(STRANGE))
            elif rng.random() < 0.3:
                number = f"{{ value = {number}, u = {size * 10.0 ** rng.uniform(-6, 0):.17g} }}"
            lines.append(f"{key} = {number}")
    return "\n".join(lines) + "\n"


def test_any_scene_gets_an_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An analysis with a random scene over the whole of the documented ranges ends within ten seconds, in words."""
    rng = np.random.default_rng(14)
    path = tmp_path / "scene.toml"
    for number in range(FILES):
        text = scene_text(rng)
        path.write_text(text, "utf-8")
        with answer_within(SECONDS):
            code = main(["analyse", "--json", str(sample_data() / POSITION), "--scene", str(path)])
        said = capsys.readouterr()
        assert code in ANSWERS, (number, text)
        assert "Traceback" not in said.err, (number, text)
        if code == 2:
            assert said.err.count("\n") == 1, said.err
