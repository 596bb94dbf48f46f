"""The commands where Python lacks what Windows lacks: POSIX modules, two signals, locks, timers and flags of files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Cli

WITHOUT = """
import os, signal, sys
records = any(" record " in word for word in sys.argv)  # pyserial reads a port by two of them here, not on Windows
for module in ("pty", "tty", "grp", "pwd", "resource", *(() if records else ("fcntl", "termios"))):
    sys.modules[module] = None
of_system = "sched_getaffinity fdatasync O_NONBLOCK O_NOCTTY O_NOFOLLOW"
for owner, names in ((signal, "SIGHUP SIGALRM setitimer ITIMER_REAL pthread_sigmask"), (os, of_system)):
    for name in names.split():
        if hasattr(owner, name):
            delattr(owner, name)
"""


CALLS = """
import sys
from springmass.cli import main
if __name__ == "__main__":
    sys.exit(max(main(line.split()) for line in sys.argv[1:]))
"""
RECORDING = Path(__file__).parents[2] / "sample_data" / "undamped_simulated_position.txt"


@pytest.mark.parametrize(
    "lines",
    [
        (
            f"analyse {RECORDING} --json",
            f"convert {RECORDING} run.h5",
            f"batch {RECORDING} -o course --accuracy fast --jobs 2",
        ),
        ("-q record --simulate --seconds 1 -o recorded.h5", f"analyse {RECORDING} --json"),
    ],
    ids=["files", "record"],
)
def test_commands_end_as_elsewhere_with_the_same_numbers(tmp_path: Path, cli: Cli, lines: tuple[str, ...]) -> None:
    """In one process that lacks them all, as do those that it starts: no error, and each digit of an analysis."""
    (tmp_path / "sitecustomize.py").write_text(WITHOUT)
    (tmp_path / "calls.py").write_text(CALLS)
    lacking = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "calls.py", *lines]
    done = subprocess.run(command, cwd=tmp_path, env=lacking, capture_output=True, text=True, timeout=300, check=False)
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr
    there = next(json.loads(line) for line in done.stdout.splitlines() if line.startswith("{"))
    (here,) = cli("analyse", RECORDING, "--json").results
    assert there["estimates"] == here["estimates"]
