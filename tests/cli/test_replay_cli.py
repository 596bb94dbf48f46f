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


@pytest.fixture
def virtual(monkeypatch: pytest.MonkeyPatch) -> list[VirtualClock]:
    """Put a clock that never waits in place of the machine's; return those that were made."""
    made: list[VirtualClock] = []

    def clock() -> VirtualClock:
        made.append(VirtualClock(10**9))
        return made[-1]

    monkeypatch.setattr("springmass.commands.replay.SystemClock", clock)
    return made


def table(text: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the rows of replay's output, its first line checked."""
    head, *rows = text.splitlines()
    assert head == "time_s\tdistance_m\tflags"
    return np.array([[float(cell) for cell in row.split("\t")] for row in rows])


def content(path: Path) -> tuple[Any, ...]:
    """Return the samples of a run file, bit for bit."""
    with springmass.open_run(path) as run:
        block = run.samples()
    return block.t.tobytes(), block.distance.tobytes(), block.flags.tobytes(), len(block)


def test_every_pace_gives_the_same_run_file(cli: Cli, data: Path, tmp_path: Path, virtual: list[VirtualClock]) -> None:
    """As recorded, ten times as fast and as fast as possible: identical samples, and two minutes take no time."""
    old = data / "damped_simulated_position.txt"
    contents = []
    for speed in ("1", "10", "max"):
        path = tmp_path / f"{speed}.h5"
        done = cli("replay", old, "--speed", speed, "-o", path)
        assert (done.code, done.out) == (0, "")
        contents.append(content(path))
    block = springmass.load(old).samples
    assert contents[0] == contents[1] == contents[2]
    assert contents[0] == (block.t.tobytes(), block.distance.tobytes(), block.flags.tobytes(), 12000)
    waited = [(clock.now_ns() - 10**9) / 1e9 for clock in virtual]
    assert waited == pytest.approx([119.99, 11.999], abs=1e-6)


def test_a_replayed_run_file_analyses_as_the_recording(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The way through a replay changes no estimate."""
    path = tmp_path / "run.h5"
    assert cli("replay", recording, "--speed", "max", "-o", path).code == 0
    a, b = (cli("analyse", "--json", file).results[0] for file in (recording, path))
    assert (a["estimates"], a["quality"]) == (b["estimates"], b["quality"])


def test_stdout_holds_a_line_per_sample(cli: Cli, recording: Path) -> None:
    """Time, distance and flags, tab separated, under their names; nothing on stderr."""
    done = cli("replay", recording, "--speed", "max")
    assert (done.code, done.err) == (0, "")
    block = springmass.load(recording).samples
    rows = table(done.out)
    np.testing.assert_allclose(rows[:, 0], block.t, atol=5e-7)
    np.testing.assert_allclose(rows[:, 1], block.distance, atol=5e-7)
    np.testing.assert_array_equal(rows[:, 2], block.flags)


def test_a_missing_sample_is_printed_as_such(cli: Cli, write: Callable[..., Path], rows: list[bytes]) -> None:
    """It has its line, NaN and its flags."""
    done = cli("replay", write([*rows[:20], b"0.20"]), "--speed", "max")
    assert done.out.splitlines()[-1] == "0.200000\tNaN\t33"


def test_seek_starts_there(cli: Cli, recording: Path, virtual: list[VirtualClock]) -> None:
    """The first sample is the one at the second asked for, and what lies before takes no time."""
    done = cli("replay", recording, "--seek", "7.5")
    rows = table(done.out)
    assert (rows[0, 0], rows[-1, 0], len(rows)) == (7.5, 9.99, 250)
    assert virtual[0].now_ns() - 10**9 == pytest.approx(2.49e9, abs=1e3)


def test_seek_past_the_end_gives_no_samples(cli: Cli, recording: Path) -> None:
    """The column names stand alone."""
    done = cli("replay", recording, "--speed", "max", "--seek", "99")
    assert (done.code, table(done.out).size) == (0, 0)


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


def test_a_loop_writes_no_run_file(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """It never ends, and a run file is written at the end."""
    done = cli("replay", recording, "--loop", "-o", tmp_path / "run.h5")
    assert done.code == 2
    assert "--loop never ends" in done.complaint


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
