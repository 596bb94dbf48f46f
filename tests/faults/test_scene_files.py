"""Scene files at and beyond the ends of what they may hold: an answer or one line of refusal, never a traceback."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springmass import sample_data
from springmass.cli import main

FEW, MANY = 8, 500 if os.environ.get("SPRINGMASS_TRIALS") else 80
FILES = [range(FEW), pytest.param(range(FEW, MANY), marks=pytest.mark.trials)]
SECONDS = 10
POSITION = "undamped_simulated_position.txt"
ANSWERS = {0, 2, 3}  # done, refused as a scene, nothing to analyse

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
    "start": {"displacement_m": (1e-9, 1e3, True), "velocity_m_per_s": (1e-9, 1e6, True)},
    "damping": {
        "gamma_per_s": (1e-12, 1e6, False),
        "beta_per_m_s": (1e-12, 1e6, False),
        "mu_m_per_s": (1e-12, 1e6, False),
    },
}
STRANGE = ["1e308", "-1e308", "5e-324", "nan", "inf", "1" + "0" * 400, "true", '"0.2"', "[1, 2]", "{}", "1979-05-27"]


def scene_text(rng: np.random.Generator) -> str:
    """Return a random scene: values over all orders of magnitude that are allowed, some uncertain, some strange."""
    lines = []
    for table, keys in RANGES.items():
        lines.append(f"[{table}]")
        for key, (lower, greatest, signed) in keys.items():
            if rng.random() < 0.4 and (table, key) not in {("bob", "mass_kg"), ("spring", "constant_n_per_m")}:
                continue
            size = lower * (greatest / lower) ** rng.choice([0.0, 1.0, rng.random(), 0.5])
            number = f"{size * (rng.choice([-1, 1]) if signed else 1):.17g}"
            if rng.random() < 0.02:
                number = str(rng.choice(STRANGE))
            elif rng.random() < 0.3:
                number = f"{{ value = {number}, u = {size * 10.0 ** rng.uniform(-6, 0):.17g} }}"
            lines.append(f"{key} = {number}")
    return "\n".join(lines) + "\n"


KEYS = [f"{table}.{key}" for table, keys in RANGES.items() for key in keys]
VALUES = [
    *STRANGE,
    *["-nan", "9" * 5000, "-0.0", "1e-400", "0b1", "07:32:00", "1979-13-45", "[[1], [2, [3]]]", "'below'", "'above'"],
    *["{ value = 0.2 }", "{ u = 0.2 }", "{ value = 0.2, u = -1.0 }", "{ value = 0.2, u = nan }"],
    *["{ value = 0.2, u = 1e300 }", "{ value = 0.2, u = [1] }", "{ value = { value = 0.2 } }"],
    *["{ value = 0.2, u = 0.1, unit = 'kg' }", "{ value = 0.2, value = 0.3 }"],
    *["'" + "x" * 10_000_000 + "'", '"\\u001b[2J\\u0007"', '"\\U0001F41D \\u202Egnp"'],
]
FILES_WHOLE: list[bytes] = [
    b"",
    b"\xef\xbb\xbf[bob]\nmass_kg = 0.2\n",
    b"\xff\xfe[\x00b\x00o\x00b\x00]\x00",
    bytes(range(256)),
    b"a = " + b"[" * 20_000,
    b"bob.mass_kg = " + b"{a=" * 5000,
    b".".join([b"a"] * 30_000) + b" = 1\n",
    b"".join(b"[t%d]\n" % i for i in range(7_000)),
    b"[[bob]]\nmass_kg = 0.2\n",
    b"[bob]\n[bob]\n",
    b"bob = 3\n",
    b"[bob]\n'mass\x1b[31m' = 1\n",
    b'["\\u001b[31m"]\na = 1\n',
    b"[bob]\n" + b"x" * 60_000 + b" = 1\n",
    b"[bob]\rmass_kg = 0.2\r",
    b"mass_kg = 0.2",
]


def hostile_scene(rng: np.random.Generator, number: int) -> bytes:
    """Return a scene in which one value, or the whole file, is made to harm."""
    if number % 4 == 0:
        return FILES_WHOLE[(number // 4) % len(FILES_WHOLE)]
    lines = {"bob.mass_kg": "0.2", "spring.constant_n_per_m": "14.0", "start.displacement_m": "0.05"}
    for _ in range(int(rng.integers(1, 3))):
        key = str(rng.choice([*KEYS, "sensor.position", "bob.colour", "ghost.mass_kg", "air"]))
        lines[key] = VALUES[rng.integers(len(VALUES))]
    return "\n".join(f"{key} = {value}" for key, value in lines.items()).encode()


def command(rng: np.random.Generator, scene: Path) -> list[str]:
    """Return one of the commands that read a scene."""
    record = str(sample_data() / POSITION)
    disc = str(sample_data() / "damped_simulated_position.txt")
    out = scene.with_name("out")
    choices = [
        ["analyse", "--json", record],
        ["simulate", "--json"],
        ["simulate", "--json", "--method", str(rng.choice(["strang", "verlet", "rk4", "dop853", "exact"]))],
        ["simulate", "--folder", str(out)],
        ["simulate", "--json", "--against", record],
        ["convert", record, f"{out}.h5", "--overwrite"],
        ["compare", "--json", record, disc],
    ]
    return [*choices[rng.integers(len(choices))], "--scene", str(scene)]


@pytest.mark.parametrize("files", FILES, ids=["few", "many"])
def test_any_scene_gets_an_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_within: Callable[[int], Any], files: range
) -> None:
    """Whatever a scene says, over the whole of the documented ranges and beyond, a command ends within ten seconds.

    It answers or refuses in words; what is refused is one line without control characters.
    """
    path = tmp_path / "scene.toml"
    for number in files:
        rng = np.random.default_rng([14, number])
        text = scene_text(rng).encode() if number % 2 else hostile_scene(rng, number // 2)
        path.write_bytes(text)
        arguments = command(rng, path)
        with answer_within(SECONDS):
            code = main(arguments)
        output = capsys.readouterr()
        where = (number, arguments, text[:500], output.err)
        assert code in ANSWERS, where
        assert "Traceback" not in output.err, where
        assert output.err.replace("\n", "").isprintable(), where
        if code == 2:
            assert output.err.splitlines()[-1].startswith("springmass: "), where
            assert len(output.err) < 5000, where
