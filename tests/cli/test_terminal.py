"""The program on a pseudo-terminal of 80 columns, as a person sees it."""

import os
from pathlib import Path

import pytest

from storage.run_file.reading import open_run
from tests.cli.conftest import BENCH
from tests.screen import OnTerminal

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are POSIX's")


def test_a_terminal_gets_one_page_that_fits(data: Path, tmp_path: Path) -> None:
    """Table 1, damping and warnings of a run: ±, millimetres, at most 30 lines, none broken by the terminal."""
    arguments = ["analyse", str(data / "damped_simulated_position.txt"), "--no-report"]
    arguments += ["--scene", str(data / "damped.scene.toml")]
    with OnTerminal(arguments, tmp_path) as terminal:
        assert terminal.end() == 0
    assert terminal.screen.wrapped == 0
    assert len(terminal.screen.text.splitlines()) <= 30
    assert "52.006 ± 0.0" in terminal.screen.text
    assert "s⁻¹" in terminal.screen.text
    assert "+-" not in terminal.screen.text
    table, _, sound = terminal.screen.text.partition("Sound: ")
    symbols = sound.partition(".")[0].replace("\n", " ").split(", ")
    assert len(symbols) > 12
    assert all(f" {symbol} " in table for symbol in symbols)


def test_several_runs_on_a_terminal_share_a_table_and_leave_no_bar_behind(data: Path, tmp_path: Path) -> None:
    """The bar shows how many of how many, and is gone at the end; digits of u stand in parentheses."""
    runs = [str(data / f"{name}_simulated_position.txt") for name in ("undamped", "damped", "clipped")]
    with OnTerminal(["analyse", *runs, "--no-report"], tmp_path) as terminal:
        assert terminal.end() == 0
    assert "/3" in terminal.screen.raw
    assert "/3" not in terminal.screen.text
    assert "0.790066(23) s" in terminal.screen.text
    assert terminal.screen.wrapped == 0


@pytest.mark.trials
@pytest.mark.parametrize("environment", [{"TERM": "dumb"}, {"PYTHONIOENCODING": "ascii"}])
def test_a_poor_terminal_gets_ascii(data: Path, tmp_path: Path, environment: dict[str, str]) -> None:
    """Without a cursor or without superscripts it is ASCII."""
    arguments = ["analyse", str(data / "undamped_simulated_position.txt"), "--no-report"]
    with OnTerminal(arguments, tmp_path, environment=environment) as terminal:
        assert terminal.end() == 0
    assert terminal.screen.text.isascii()
    assert "51.01 +- 0.28 mm" in terminal.screen.text


@pytest.mark.parametrize("columns", [80, pytest.param(50, marks=pytest.mark.trials)])
def test_a_recording_stays_in_its_lines_and_takes_marks(tmp_path: Path, columns: int) -> None:
    """Progress and keys are rewritten in place; space marks immediately, a word with Enter, Ctrl-C stops."""
    (tmp_path / "bench.toml").write_text(BENCH)
    with OnTerminal(["record", "--simulate", "--scene", "bench.toml", "-o", "run.h5"], tmp_path, columns) as terminal:
        terminal.until("space marks, Ctrl-C stops")
        terminal.type(" ")
        terminal.until("mark 1 at")
        terminal.type("touched\r")
        terminal.until("mark 2 at")
        assert terminal.screen.wrapped == 0
        terminal.type("\x03")
        assert terminal.end() == 130
    with open_run(tmp_path / "run.h5") as run:
        assert [mark["text"] for mark in run.provenance["marks"]] == ["mark", "touched"]
    assert "springmass analyse run.h5" in terminal.screen.text
