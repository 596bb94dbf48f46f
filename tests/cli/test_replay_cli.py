"""``springmass replay``: the samples of a recording at any pace, on stdout."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import springmass
from tests.cli.conftest import Cli


def test_the_samples_are_those_of_the_recording(cli: Cli, recording: Path) -> None:
    """A line each, from the second asked for."""
    block = springmass.load(recording).loaded.samples
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
