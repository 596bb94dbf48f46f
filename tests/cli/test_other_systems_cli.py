"""The commands where Python lacks what Windows lacks: POSIX modules, two signals, locks, timers and flags of files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[2] / "sample_data"
WITHOUT = """
import os, signal, sys
for module in ("pty", "tty", "grp", "pwd", "resource", *(() if "record" in sys.argv else ("fcntl", "termios"))):
    sys.modules[module] = None  # pyserial reads a port by fcntl and termios here, and by other modules on Windows
of_system = "sched_getaffinity fdatasync O_NONBLOCK O_NOCTTY O_NOFOLLOW"
for owner, names in ((signal, "SIGHUP SIGALRM setitimer ITIMER_REAL pthread_sigmask"), (os, of_system)):
    for name in names.split():
        if hasattr(owner, name):
            delattr(owner, name)
"""


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command whose processes lack them all."""
    (folder / "site").mkdir(exist_ok=True)
    (folder / "site" / "sitecustomize.py").write_text(WITHOUT)
    own = {**os.environ, "PYTHONPATH": str(folder / "site")}
    command = [sys.executable, "-m", "springmass", *words]
    return subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    "words",
    [
        ("analyse", str(SAMPLES / "undamped_simulated_position.txt"), "--mass-kg", "0.2"),
        ("convert", str(SAMPLES / "undamped_simulated_position.txt"), "run.h5"),
        ("record", "--simulate", "--seconds", "2", "-o", "run.h5"),
        (
            "batch",
            str(SAMPLES / "undamped_simulated_position.txt"),
            "-o",
            "course",
            "--accuracy",
            "fast",
            "--jobs",
            "2",
        ),
    ],
    ids=lambda words: words[0],
)
def test_a_command_ends_as_elsewhere(tmp_path: Path, words: tuple[str, ...]) -> None:
    """The same exit code, no traceback."""
    done = run(tmp_path, *words)
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr


def test_the_numbers_are_the_same(tmp_path: Path) -> None:
    """A run file written there is read here, with the same period to the last digit."""
    data = str(SAMPLES / "damped_simulated_position.txt")
    there = json.loads(run(tmp_path, "analyse", data, "--json").stdout)
    here = subprocess.run(
        [sys.executable, "-m", "springmass", "analyse", data, "--json"], capture_output=True, text=True, check=True
    )
    assert there["estimates"] == json.loads(here.stdout)["estimates"]
