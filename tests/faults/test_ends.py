"""Every end of a recording, as docs/reference/ends-of-a-recording.md has them, while every display fails."""

import contextlib
import fcntl
import os
import pty
import re
import resource
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from springmass.cli import main
from storage.run_file.reading import open_run
from tests.faults.conftest import usual_signals, whole_numbers_of
from tests.sampling import sampled

ANSWER_S = 100.0
"""The program answers within ten seconds of the end, or of a fault's, where the machine is not ten times as busy."""
SECONDS = 8000
"""Bytes of log that a little more than a second fills."""
TOGETHER_S = 0.2
"""Twice the time within which two signals count as one."""
FEW = 50
"""Readings that are there at least, after so many bytes."""

PATCHES = {
    "analysis raises": "raise IndexError('list index out of range')",
    "analysis has no memory": "raise MemoryError",
    "analysis hangs": "threading.Event().wait()",
    "analysis ends its thread": "raise SystemExit(7)",
}


def patch(body: str) -> str:
    """Return Python that has the live analysis do something else."""
    return (
        "import threading\nfrom springmass.runs.rolling import Rolling\n"
        f"def latest(self):\n    {body}\nRolling.latest = latest"
    )


@contextlib.contextmanager
def failing(display: str) -> Iterator[dict[str, Any]]:
    """Give how a recording is started whose display fails in a certain way."""
    with contextlib.ExitStack() as stack:
        if display in PATCHES:
            yield {"before": patch(PATCHES[display])}
        elif display == "reader of stderr gone":
            read, write = os.pipe()
            os.close(read)
            stack.callback(os.close, write)
            yield {"stderr": write}
        elif display == "nobody reads stderr":
            read, write = os.pipe()
            stack.callback(os.close, read)
            stack.callback(os.close, write)
            size = fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
            os.write(write, b"x" * size)
            yield {"stderr": write}
        elif display == "stderr on a full disk":
            yield {"stderr": stack.enter_context(open("/dev/full", "wb"))}
        elif display == "stderr closed":
            yield {"prepare": lambda: os.close(2)}
        elif display == "terminal closed":
            master, slave = pty.openpty()
            os.close(master)
            stack.callback(os.close, slave)
            yield {"stderr": slave}
        elif display == "no room for the analysis":
            # The libraries of linear algebra would try for ever to get what there is not.
            yield {"prepare": lambda: resource.setrlimit(resource.RLIMIT_DATA, (300 << 20, 300 << 20))}
        else:
            assert display == "none"
            yield {}


def end_by_signal(number: signal.Signals, times: int = 1) -> Callable[[Any], None]:
    """Return how a recording is ended by a signal, which ``timeout`` and some terminals send twice."""

    def end(recording: Any) -> None:
        recording.until_bytes(SECONDS)
        for _ in range(times):
            recording.process.send_signal(number)

    return end


def wait(recording: Any) -> None:
    """Have the seconds end it."""
    recording.until_bytes(SECONDS // 4)


RUN_S = 2.0
ENDINGS: dict[str, tuple[tuple[str, ...], Callable[[Any], None], int]] = {
    "seconds": (("--seconds", str(RUN_S)), wait, 0),
    "Ctrl-C": ((), end_by_signal(signal.SIGINT), 130),
    "kill": ((), end_by_signal(signal.SIGTERM, 2), 130),
    "a closed terminal": ((), end_by_signal(signal.SIGHUP), 130),
}


def play(bench: Any, folder: Path, display: str, end: str) -> None:
    """Play one end while a display fails, and hold what is left against what was sent."""
    arguments, bring, code = ENDINGS[end]
    out = folder / "run.h5"
    with bench.feeder() as feeder, failing(display) as started:
        extra = started.pop("prepare", lambda: None)

        def prepare() -> None:
            usual_signals()
            extra()

        recording = bench.record(feeder.port, out, *arguments, prepare=prepare, **started)
        bring(recording)
        assert recording.ended(ANSWER_S + RUN_S * (end == "seconds")) == code
    assert len(whole_numbers_of(out)) > FEW
    assert not recording.log.exists()
    with open_run(out) as run:
        (ended,) = [event["facts"] for event in run.provenance["events"] if event["kind"] == "ended"]
        failed = [event["kind"] for event in run.provenance["events"] if event["kind"].endswith("_failed")]
    assert ended["by"] in (end, "SIGTERM")
    if display != "none":
        assert failed, "what failed is not in the run"
        assert sum(ended["failures"].values()) >= 1


@pytest.mark.trials
@pytest.mark.parametrize(
    "display",
    [
        *PATCHES,
        *("reader of stderr gone", "nobody reads stderr", "stderr on a full disk", "stderr closed", "terminal closed"),
        "no room for the analysis",
    ],
)
def test_no_display_ends_a_recording(bench: Any, tmp_path: Path, display: str) -> None:
    """Whatever becomes of stderr or of the live analysis, the seconds end the run, with all its readings."""
    play(bench, tmp_path, display, "seconds")


@pytest.mark.parametrize("end", sampled(["Ctrl-C", "a closed terminal", "kill"], 1))
def test_the_user_ends_a_recording(bench: Any, tmp_path: Path, end: str) -> None:
    """Ctrl-C, kill and a closed terminal leave the run file, complete up to there, and no log."""
    play(bench, tmp_path, "none", end)


HUNG_DISK = """
import os, time
from storage.recorder import Recorder

made = Recorder.__init__.__kwdefaults__["open_file"]

class Disk:
    def __init__(self, path):
        self.file = made(path)
        self.hung = path.with_suffix(".hung")
    def write(self, data):
        while self.hung.exists():
            time.sleep(0.01)
        return self.file.write(data)
    def sync(self):
        self.file.sync()
    def close(self):
        self.file.close()

close = Recorder.close

def closing(self):
    self.path.with_suffix(".closing").touch()
    close(self)

Recorder.__init__.__kwdefaults__["open_file"] = Disk
Recorder.close = closing
"""


@pytest.mark.trials
def test_a_second_ctrl_c_while_the_disk_hangs_leaves_the_log_and_says_where(bench: Any, tmp_path: Path) -> None:
    """The first waits for the disk; the second ends immediately, removes nothing, and names the log and a remedy."""
    out = tmp_path / "run.h5"
    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, before=HUNG_DISK, stderr=subprocess.PIPE, prepare=usual_signals)
        recording.until_bytes(SECONDS)
        (tmp_path / "run.hung").touch()
        sent = feeder.sent
        recording.until(lambda: feeder.sent >= sent + 100)
        recording.process.send_signal(signal.SIGINT)
        recording.until((tmp_path / "run.closing").exists)
        threading.Event().wait(TOGETHER_S)
        recording.process.send_signal(signal.SIGINT)
        assert recording.ended(ANSWER_S) == 130
        output = recording.said()
    assert f"the log stays: {recording.log}" in output
    assert "springmass recover" in output
    assert re.search(r"\b[1-9][0-9]+ reads", output), "what was given up is counted on the screen"
    assert not out.exists()
    assert main(["recover", str(recording.log)]) == 0
    assert len(whole_numbers_of(out)) > FEW


@pytest.mark.trials
def test_a_disk_that_takes_nothing_more_ends_the_recording_with_what_it_has(bench: Any, tmp_path: Path) -> None:
    """At a file-size limit: exit code 4, one line that says why, the run file of what came before, and the log."""
    out = tmp_path / "run.h5"

    def limited() -> None:
        usual_signals()
        resource.setrlimit(resource.RLIMIT_FSIZE, (SECONDS, resource.RLIM_INFINITY))

    with bench.feeder() as feeder:
        recording = bench.record(feeder.port, out, stderr=subprocess.PIPE, prepare=limited)
        assert recording.ended(ANSWER_S) == 4
        output = recording.said()
    assert "could not be continued (File too large)" in output
    assert recording.log.exists()
    assert "springmass recover" in output  # the run file holds the log, so the limit is too low for it as well
    assert not out.exists()
    assert main(["recover", str(recording.log)]) == 0
    assert len(whole_numbers_of(out)) > FEW
