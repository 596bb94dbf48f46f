"""``springmass replay``: the samples of the record at any pace, on stdout or into a run file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from acquisition.block import Block
from acquisition.clock import VirtualClock
from acquisition.source import SourceInfo

Cli = Callable[..., Any]


def content(path: Path) -> tuple[Any, ...]:
    """Return the samples of a run file, bit for bit."""
    with springmass.open_run(path) as run:
        block = run.samples()
    return block.t.tobytes(), block.distance.tobytes(), block.flags.tobytes(), len(block)


def test_the_kind_of_what_is_replayed_stays_true(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A live run replayed is a replay, a simulated one stays simulated."""
    t = np.arange(50) / 100
    block = Block(0, t, 0.2 + 0.05 * np.cos(8 * t), np.zeros(50, np.uint8))
    for kind, expected in (("live", "replay"), ("simulated", "simulated")):
        source = springmass.write_run(
            tmp_path / f"{kind}.h5",
            [block],
            SourceInfo(kind, "bench", 100.0),  # type: ignore[arg-type]
        )
        out = tmp_path / f"{kind}_again.h5"
        assert cli("replay", source, "--speed", "max", "-o", out).code == 0
        with springmass.open_run(out) as run:
            assert run.info.kind == expected


def test_a_standing_run_file_is_not_overwritten(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The refusal comes before play begins."""
    path = tmp_path / "run.h5"
    path.write_bytes(b"mine")
    done = cli("replay", recording, "--speed", "max", "-o", path)
    assert done.code == 2
    assert "choose another name" in done.complaint
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf", "fast"])
def test_an_impossible_speed_is_a_usage_error(cli: Cli, recording: Path, speed: str) -> None:
    """A speed is a positive number, or max."""
    done = cli("replay", recording, f"--speed={speed}")
    assert (done.code, done.out) == (2, "")
    assert "--speed" in done.err


@pytest.mark.parametrize("output", [True, False])
def test_ctrl_c_ends_it_cleanly(
    cli: Cli, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, output: bool
) -> None:
    """Exit code 130, one line, and neither a run file nor a part of one is left."""

    class Interrupting(VirtualClock):
        def sleep_until_ns(self, deadline_ns: int) -> None:
            if deadline_ns > 2_000_000_000:
                raise KeyboardInterrupt
            super().sleep_until_ns(deadline_ns)

    monkeypatch.setattr("springmass.commands.replay.SystemClock", Interrupting)
    folder = tmp_path / "out"
    folder.mkdir()
    done = cli("replay", recording, *(["-o", folder / "run.h5"] if output else []))
    assert (done.code, done.complaint) == (130, "springmass: interrupted")
    assert list(folder.iterdir()) == []
    assert output or len(done.out.splitlines()) > 150


@pytest.mark.skipif(sys.platform == "win32", reason="pipes end otherwise there")
def test_a_reader_that_goes_away_ends_it_quietly(recording: Path) -> None:
    """``springmass replay ... | head`` is no failure."""
    command = [sys.executable, "-m", "springmass", "replay", str(recording), "--loop", "--speed", "max"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "time_s\tdistance_m\tflags\n"
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(timeout=120) == 0
