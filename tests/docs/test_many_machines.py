"""The script on the page about many machines gives the same files as one process."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.courses import contents, short_course

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "many-machines.md"
(SCRIPT,) = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
STAND_IN = """
from distributed import LocalCluster

class SLURMCluster(LocalCluster):
    def __init__(self, *, cores, processes, memory, walltime):
        super().__init__(n_workers=0, threads_per_worker=cores, processes=False, protocol="tcp://",
                         dashboard_address=None)

    def scale(self, n=0, *, jobs=None):
        return super().scale(n if jobs is None else 1)
"""
"""A cluster on this machine under the name of dask-jobqueue's, with the parameters that the script uses."""
TOGETHER = ("batch", "recordings/", "--runs", "runs.csv", "-o", "one/course", "--jobs", "1")
LIMIT_S = 300


@pytest.mark.trials
def test_the_script_for_slurm_gives_the_files_of_one_process(tmp_path: Path) -> None:
    """The recordings of the page's script are analysed by the workers that it starts."""
    short_course(tmp_path / "recordings", 6)
    rows = "".join(f"recordings/run{i:03d}.txt,0.2\n" for i in range(6))
    (tmp_path / "runs.csv").write_text(f"path,bob_mass_kg\n{rows}", encoding="utf-8")
    (tmp_path / "dask_jobqueue.py").write_text(STAND_IN, encoding="utf-8")
    (tmp_path / "course.py").write_text(SCRIPT, encoding="utf-8")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in ([sys.executable, "course.py"], [sys.executable, "-m", "springmass", *TOGETHER]):
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=LIMIT_S
        )
        assert done.returncode == 0, done.stderr
    assert contents(tmp_path / "course") == contents(tmp_path / "one/course")
