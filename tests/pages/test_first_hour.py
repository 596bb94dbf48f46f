"""The first hour with the program, in the order in which a new user meets it: a terminal of 80 columns, and a browser.

Each step is a command as it is typed, what has to stand on the screen, and the exit code.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from springmass.runs.loading import sample_data
from tests.screen import OnTerminal

SCENE = """
[bob]
mass_kg = { value = 0.2, u = 0.0001 }
[spring]
constant_n_per_m = 14.0
mass_kg = { value = 0.01, u = 0.0005 }
[air]
temperature_c = { value = 21.0, u = 1.0 }
[start]
displacement_m = 0.05
"""
IN_A_NOTEBOOK = """
import matplotlib
matplotlib.use("Agg")
import springmass as sm
a = sm.analyse("damped.txt", scene="bench.toml")
print(a)
print(2 * a["period"], a["k"] > 0, a["k"].unit)
print(type(a.plot("amplitude")).__name__, a.to_dataframe().shape[1] > 2, "distance" in a.to_dataset())
import xarray as xr
with xr.open_dataset("bob.h5") as samples:
    print(sorted(samples.data_vars)[:1], samples.sizes["time"] > 300)
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder as somebody has it: two old recordings, and what is known of the bench."""
    for name in ("undamped", "damped"):
        shutil.copy(sample_data() / f"{name}_simulated_position.txt", tmp_path / f"{name}.txt")
    (tmp_path / "bench.toml").write_text(SCENE)
    (tmp_path / "runs").mkdir()
    return tmp_path


@pytest.fixture
def typed(bench: Path) -> Callable[..., str]:
    """Return a function that types a command, and gives the screen at its end; no line is wider than the terminal."""

    def type_it(*arguments: str, ends: int = 0, shows: tuple[str, ...] = ()) -> str:
        with OnTerminal(list(arguments), bench) as terminal:
            code, text = terminal.end(), terminal.screen.text
        assert code == ends, text
        for words in shows:
            assert words in text, f"{words!r} is not on the screen of {arguments}:\n{text}"
        return str(text)

    return type_it


@pytest.mark.trials
def test_from_a_file_to_a_figure(typed: Callable[..., str], clipped: Callable[..., list[str]], bench: Path) -> None:
    """One run with its report, two in one table, the comparison: nothing wraps, nothing is clipped on any medium."""
    shown = typed(
        "analyse",
        "damped.txt",
        "--scene",
        "bench.toml",
        "--figures",
        "svg",
        shows=("period", "±", "report: damped.txt.results/report.html"),
    )
    assert max(map(len, shown.splitlines())) <= 80
    for width in ("laptop", "phone", "A4"):
        assert clipped(bench / "damped.txt.results" / "report.html", width) == []
    assert (bench / "damped.txt.results" / "figures" / "amplitude.svg").is_file()
    for name in ("undamped", "damped"):
        shutil.move(bench / f"{name}.txt", bench / "runs")
    together = typed("analyse", "runs", shows=("undamped", "damped", "next: springmass compare runs"))
    assert len(re.findall(r"^ *period", together, re.MULTILINE)) == 1
    both = ("runs/undamped.txt", "runs/damped.txt")
    scenes = ("--scene", "bench.toml", "--scene", "bench.toml")
    typed("compare", *both, *scenes, shows=("N/m", "-o DIR writes the report"))
    typed("-q", "analyse", both[0], "--no-report", shows=("period",))
    typed("-v", "analyse", both[0], "--no-report", shows=("read: runs/undamped.txt", "scene that states nothing"))


@pytest.mark.trials
def test_at_the_bench(typed: Callable[..., str], bench: Path) -> None:
    """Recorded by a key, marked, stopped; noted beside it; analysed with what was noted; read in Python."""
    with OnTerminal(["record", "--simulate", "--scene", "bench.toml", "-o", "bob.h5"], bench) as terminal:
        terminal.until("space marks, Ctrl-C stops")
        terminal.type(" ")
        terminal.until("mark 1 at")
        terminal.until("T 0.75")
        terminal.until("6 s |")
        terminal.type("\x03")
        assert terminal.end() == 130
        assert terminal.screen.wrapped == 0
        assert "next: springmass analyse" in terminal.screen.text
    typed("scene", "bob.h5", "--note", "cardboard disc", "--mark", "2=door", shows=("used from now on",))
    typed("analyse", "bob.h5", shows=("read from the notes next to the file", "period", "N/m"))
    page = (bench / "bob.results" / "report.html").read_text("utf-8")
    assert all(words in page for words in ("cardboard disc", "door"))
    typed("replay", "bob.h5", "--speed", "max", "-o", "again.h5", shows=("next: springmass analyse again.h5",))
    (bench / "notebook.py").write_text(IN_A_NOTEBOOK)
    done = subprocess.run([sys.executable, "notebook.py"], cwd=bench, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "period" in done.stdout
    assert len(done.stdout.splitlines()) <= 20
    assert done.stdout.splitlines()[-1] == "['distance'] True"


@pytest.mark.trials
def test_a_sensor_that_says_nothing(bench: Path) -> None:
    """A port on which nothing speaks is named with what to check, and its recording ends in exit code 4."""
    master, slave = os.openpty()
    try:
        arguments = ["record", "--port", os.ttyname(slave), "--sensor", "line-protocol", "--seconds", "4"]
        with OnTerminal(arguments, bench) as terminal:
            terminal.until("baud")
            assert terminal.end() == 4
    finally:
        os.close(master)
        os.close(slave)
