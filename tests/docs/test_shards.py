"""The recipes of the page on many machines do what it says: the same bytes as one pass by one process."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.courses import contents, short_course

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "many-machines.md"
GNU_PARALLEL, XARGS, SLURM = re.findall(r"^```sh\n((?:parallel|seq|#!/bin/sh).*?)^```$", PAGE.read_text(), re.M | re.S)
TOGETHER = "springmass batch recordings/ --runs runs.csv -o course --jobs 1 --reports 0"
TASKS = 4

pytestmark = [
    pytest.mark.trials,
    pytest.mark.skipif(os.name == "nt", reason="the recipes are written for a POSIX shell"),
]


def passed(folder: Path, script: str, **said: str) -> None:
    """Run a script in a folder of recordings, with this program under its name."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", **said}
    done = subprocess.run(
        ["sh", "-ec", script], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture
def course(tmp_path: Path) -> Path:
    """Six recordings with their table, and what one process makes of them."""
    short_course(tmp_path / "recordings", 6)
    rows = "".join(f"recordings/run{i:03d}.txt,0.2\n" for i in range(6))
    (tmp_path / "runs.csv").write_text(f"path,bob_mass_kg\n{rows}")
    passed(tmp_path, TOGETHER)
    (tmp_path / "course").rename(tmp_path / "one")
    return tmp_path


@pytest.mark.skipif(shutil.which("parallel") is None, reason="GNU parallel is not installed; .ci/run installs it")
def test_gnu_parallel(course: Path) -> None:
    """Shards by GNU parallel, and one call that puts them together."""
    passed(course, GNU_PARALLEL.splitlines()[0])
    passed(course, TOGETHER)
    assert contents(course / "course") == contents(course / "one")


def test_xargs(course: Path) -> None:
    """Shards by xargs."""
    passed(course, XARGS)
    passed(course, TOGETHER)
    assert contents(course / "course") == contents(course / "one")


def test_an_array_of_slurm(course: Path) -> None:
    """Each task of the array does its part by what Slurm tells it; a task that died is done by the job that waits."""
    told = {"SLURM_SUBMIT_DIR": str(course), "SLURM_CPUS_PER_TASK": "1", "SLURM_ARRAY_TASK_COUNT": str(TASKS)}
    for task in range(1, TASKS):
        passed(course, SLURM, SLURM_ARRAY_TASK_ID=str(task), **told)
    passed(course, TOGETHER)
    assert contents(course / "course") == contents(course / "one")
