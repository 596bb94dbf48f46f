"""The simulated recordings: reproducible, in the form of MotionSensor.vi, and true to their truth files."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sample_data import generate

FOLDER = Path(__file__).resolve().parents[3] / "sample_data"
IMPORTED = re.compile(r"^(?:from|import) (\w+)", re.MULTILINE)


def test_files_regenerate_byte_for_byte() -> None:
    """Every file is made again byte for byte, and nothing simulated lies there that is not made."""
    made = generate.every_file()
    assert {name: (FOLDER / name).read_bytes() for name in made} == made
    kept = {path.name for pattern in ("*.txt", "*.json", "*.toml") for path in FOLDER.glob(pattern)}
    assert kept == set(made)


def test_generator_shares_no_code_with_the_project() -> None:
    """The generator imports the standard library and numpy only."""
    source = (FOLDER / "generate.py").read_text("utf-8")
    imported = set(IMPORTED.findall(source))
    assert imported <= {*sys.stdlib_module_names, "numpy"}
