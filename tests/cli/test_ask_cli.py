"""``analyse --ask``, ``analyse -`` and ``analyse --template latex``."""

from __future__ import annotations

import io
import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from springmass.terminal.asking import quantity_of

Cli = Callable[..., Any]


@pytest.fixture
def copy(data: Path, tmp_path: Path) -> Path:
    """Return a recording that is not the bundled one, next to which bench data may be saved."""
    path = tmp_path / "bob.txt"
    path.write_bytes((data / "undamped_simulated_position.txt").read_bytes() + b"\n")
    return path


def test_answers_give_the_spring_constant_and_are_saved(
    cli: Cli, copy: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A wrong answer is asked again, an empty one skipped; the next analysis knows the masses without asking."""
    monkeypatch.setattr("sys.stdin", io.StringIO("heavy\n200.7 g +- 0.1\n\n102 mm\n"))
    done = cli("analyse", copy, "--ask", "-o", tmp_path / "out")
    assert done.code == 0, done.err
    assert "needs the mass" not in done.out
    assert "N/m" in done.out
    (again,) = cli("analyse", copy, "--json").results
    assert "spring_constant" in again["estimates"]
    scene = tomllib.loads(next(tmp_path.glob("*.about.toml")).read_text("utf-8"))["scene"]
    assert scene["bob"]["mass_kg"] == {"value": 0.2007, "u": 0.0001}
    assert scene["disc"]["diameter_m"] in (0.102, {"value": 0.102, "u": 0.0})


def test_an_input_that_ends_is_said(cli: Cli, copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing waits, and the exit code is that of a usage error."""
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    done = cli("analyse", copy, "--ask", "--no-report")
    assert done.code == 2
    assert "--mass-kg" in done.err


@pytest.mark.parametrize("text", ["", "-2 kg", "0", "2 lb", "1.2.3 kg", "2 kg +- 1 s"])
def test_what_is_no_mass_is_refused(text: str) -> None:
    """Only a positive number with one of the units is an answer."""
    with pytest.raises(ValueError, match="give a"):
        quantity_of(text, {"kg": 1.0, "g": 1e-3})


def test_a_lab_report_is_written(cli: Cli, data: Path, tmp_path: Path) -> None:
    """It holds Table 1, every figure that is written next to it, and the statement of uncertainty."""
    recording, scene = (data / f"damped{name}" for name in ("_simulated_position.txt", ".scene.toml"))
    done = cli("analyse", recording, "--scene", scene, "--template", "latex", "-o", tmp_path)
    assert done.code == 0, done.err
    (document,) = tmp_path.rglob("lab-report.tex")
    text = document.read_text("utf-8")
    assert text.count(r"\begin{document}") == text.count(r"\end{document}") == 1
    assert text.count(r"\begin{figure}") == text.count(r"\includegraphics") > 2
    assert text.count("{") == text.count("}")
    assert "0.790066" in text
    # Where inputenc does not know a letter, pdflatex stops.
    assert text.isascii()


def test_standard_input_is_read(cli: Cli, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A dash stands for it; the numbers are those of the file."""
    path = data / "undamped_simulated_position.txt"
    (expected,) = cli("analyse", path, "--json").results

    class Piped:
        buffer = io.BytesIO(path.read_bytes())

    monkeypatch.setattr("sys.stdin", Piped())
    done = cli("analyse", "-", "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["estimates"]["period"] == expected["estimates"]["period"]
