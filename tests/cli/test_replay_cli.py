"""``springmass replay``: the samples of a recording at any pace, on stdout or into a run file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from storage.run_file.reading import open_run

Cli = Callable[..., Any]


def test_the_samples_are_those_of_the_recording(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """In a run file bit for bit, and a line each on stdout; nothing is overwritten."""
    block = springmass.load(recording).loaded.samples
    out = tmp_path / "run.h5"
    assert cli("replay", recording, "--speed", "max", "-o", out).code == 0
    with open_run(out) as run:
        again, kind = run.samples(), run.info.kind
    assert (again.t.tobytes(), again.distance.tobytes()) == (block.t.tobytes(), block.distance.tobytes())
    assert kind == "replay"
    done = cli("replay", springmass.sample_data() / "damped_simulated_position.txt", "--speed", "max", "-o", out)
    assert (done.code, str(out) in done.complaint) == (2, True)
    done = cli("replay", recording, "--speed", "max", "--seek", "7.5")
    rows = np.array([line.split("\t") for line in done.out.splitlines()[1:]], float)
    assert (done.code, done.err, len(rows)) == (0, "", 250)
    np.testing.assert_allclose(rows[:, :2].T, [block.t[750:], block.distance[750:]], atol=5e-7)


@pytest.mark.skipif(sys.platform == "win32", reason="pipes end otherwise there")
def test_a_reader_that_goes_away_ends_it_quietly(recording: Path) -> None:
    """``springmass replay ... | head`` is no failure."""
    command = [sys.executable, "-m", "springmass", "replay", str(recording), "--loop", "--speed", "max"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(timeout=120) == 0
