"""Ctrl-C, SIGTERM and SIGHUP while a file is written: it is whole or absent, and the program says one line at most.

One child process works again and again and sends itself a signal at a random moment, so a crash is seen, and the
moments lie in the work and not in the start of Python. ``SPRINGMASS_TRIALS`` asks for 200 moments of each command.
"""

import itertools
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from springmass.cli import main
from storage.run_file.reading import open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from tests.faults.conftest import SIGNALS, line_of, usual_signals
from tests.wire import append

TRIALS = 200 if os.environ.get("SPRINGMASS_TRIALS") else 8
LIMIT_S = 600.0
ANSWER_S = 60.0
"""The program leaves within two seconds, where the machine is not thirty times as busy."""


def inputs(folder: Path, samples: int) -> dict[str, list[str]]:
    """Write a recording and a log, and return the command lines that make a run file of each."""
    t = 0.01 * np.arange(samples)
    table = np.column_stack([t, 0.5 + 0.05 * np.cos(7.0 * t)])
    np.savetxt(folder / "run.csv", table, "%.6f", ",", header="time_s,distance_m", comments="")
    log = WireLogWriter(
        folder / "log.wire", LogHeader(sensors=(SensorEntry(0, "line-protocol"),), mono_ns=0, unix_ns=0)
    )
    for number in range(samples):
        append(log, RecordKind.DATA, line_of(number), mono_ns=10_000_000 * number)
    append(log, RecordKind.END, b"{}", mono_ns=10_000_000 * samples)
    log.close()
    return {
        "convert": ["convert", str(folder / "run.csv"), str(folder / "out.h5")],
        "recover": ["recover", str(folder / "log.wire"), "-o", str(folder / "out.h5")],
    }


def work(folder: Path) -> None:
    """Do the work with a signal at a random moment, and print every exit code with what there is of the file."""
    rng = np.random.default_rng(TRIALS)
    out = folder / "out.h5"
    for command, words in inputs(folder, 2000).items():
        for _ in range(2):  # the first also imports what the command needs
            out.unlink(missing_ok=True)
            start = time.monotonic()
            main(words)
            took_s = time.monotonic() - start
        before = contents(folder)
        for number in itertools.islice(itertools.cycle(SIGNALS), TRIALS):
            out.unlink(missing_ok=True)
            timer = threading.Timer(took_s * rng.random(), os.kill, (os.getpid(), number))
            usual_signals()
            timer.start()
            code = main(words)
            for each in SIGNALS:
                signal.signal(each, signal.SIG_IGN)  # the signal may come after the work
            timer.join()
            left = contents(folder)
            left.pop(".out.h5.part", None)  # the next writer takes it, see below
            assert left == before, sorted(left)
            print(command, code, state_of(out), flush=True)
        out.unlink(missing_ok=True)
        assert main(words) == 0
        assert contents(folder) == before, sorted(contents(folder))


def contents(folder: Path) -> dict[str, bytes]:
    """Return what is in the folder besides the run file."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "out.h5"}


def state_of(out: Path) -> str:
    """Return whether a run file is whole, by its digests, or absent; raise if it is neither."""
    if not out.exists():
        return "absent"
    with open_run(out) as run:
        run.verify()
    return "whole"


def test_a_file_is_whole_or_absent_after_a_signal(tmp_path: Path) -> None:
    """Whenever the signal comes: exit code 130, or 0 with the whole file; no crash, no lasting leftovers."""
    child = [sys.executable, "-B", "-m", __name__, str(tmp_path)]
    done = subprocess.run(child, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    ends = [tuple(line.split()) for line in done.stdout.splitlines()]
    for command in ("convert", "recover"):
        of_command = [end[1:] for end in ends if end[0] == command]
        assert len(of_command) == TRIALS
        assert set(of_command) <= {("130", "absent"), ("130", "whole"), ("0", "whole")}
        assert ("130", "absent") in of_command, "no signal came in time"


@pytest.mark.trials
@pytest.mark.parametrize("command", ["analyse", "batch"])
def test_a_command_ends_after_a_signal_at_any_moment(tmp_path: Path, command: str) -> None:
    """A new process, so most moments lie in imports: exit code 130, or 0 with all files; no defect, no half file."""
    rng = np.random.default_rng(TRIALS)
    inputs(tmp_path, 2000)
    out = tmp_path / "out"
    words = {
        "analyse": ["analyse", str(tmp_path / "run.csv"), "-o", str(out)],
        "batch": ["batch", str(tmp_path / "run.csv"), "--jobs", "1", "-o", str(out)],
    }[command]
    start = time.monotonic()
    program = started(words, "")
    took_s = time.monotonic() - start
    assert program.communicate(timeout=LIMIT_S)[1]
    took_s, whole = time.monotonic() - start - took_s, written(out)
    for number in itertools.islice(itertools.cycle(SIGNALS), TRIALS):
        shutil.rmtree(out)
        program = started(words, "")
        time.sleep(took_s * rng.random())
        program.send_signal(number)
        said = program.communicate(timeout=LIMIT_S)[1]
        out.mkdir(exist_ok=True)
        assert program.returncode in (0, 130), said
        assert ("interrupted" in said) == (program.returncode == 130)
        assert "error" not in said
        left = written(out)
        assert left.items() <= whole.items() or command == "batch", sorted(left.keys() - whole.keys())
        assert program.returncode == 130 or left == whole


def written(folder: Path) -> dict[str, int]:
    """Return the finished files with their sizes; a folder or file that is being made has a name with a dot first."""
    files = (path for path in folder.rglob("*") if path.is_file())
    names = {path: path.relative_to(folder) for path in files}
    return {
        name.as_posix(): path.stat().st_size
        for path, name in names.items()
        if not any(part.startswith(".") for part in name.parts) and name.suffix not in (".db", ".lock")
    }


IMPORTING = """
import os, pathlib, signal, weakref
class Dying:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.SIGTERM)
class Finder:
    def find_spec(name, *_):
        if name == "storage.hdf5":
            dying = Dying()
            dropped = weakref.ref(dying, lambda _: (os.kill(os.getpid(), signal.SIGTERM), None))
            del dying
            type("Owner", (), {"field": Dying()})
            pathlib.Path(MARK).touch()
sys.meta_path.insert(0, Finder)
"""


def test_a_signal_in_an_import_waits_for_its_end(tmp_path: Path) -> None:
    """Python drops or converts what a handler raises in an import, so it raises afterwards; nothing else is said."""
    mark = tmp_path / "imported"
    program = started(inputs(tmp_path, 100)["convert"], IMPORTING.replace("MARK", repr(str(mark))))
    said = program.communicate(timeout=LIMIT_S)[1]
    assert (program.returncode, said) == (130, "springmass: interrupted\n")
    assert mark.exists(), "no signal came in an import"
    assert not (tmp_path / "out.h5").exists()


HUNG = """
import io, pathlib, threading
class Hung(io.FileIO):
    def write(self, data):
        print("hangs", flush=True)
        while True:
            threading.Event().wait(0.1)
opened = pathlib.Path.open
pathlib.Path.open = lambda path, mode="r", *given, **named: (
    Hung(path, mode) if path.name.endswith(".part") else opened(path, mode, *given, **named)
)
"""


def test_a_second_signal_leaves_while_the_disk_hangs(tmp_path: Path) -> None:
    """The first waits for the disk, the second does not; the log stays, and a line names it."""
    words = inputs(tmp_path, 100)["recover"]
    before = (tmp_path / "log.wire").read_bytes()
    program = started(words, HUNG)
    assert program.stdout is not None
    assert program.stdout.readline() == "hangs\n"
    program.send_signal(signal.SIGTERM)
    with pytest.raises(subprocess.TimeoutExpired):
        program.wait(0.3)
    program.send_signal(signal.SIGINT)
    said = program.communicate(timeout=ANSWER_S)[1]
    assert program.returncode == 130
    assert said == f"springmass: stopped immediately; the log stays: {tmp_path / 'log.wire'}\n"
    assert not (tmp_path / "out.h5").exists()
    assert (tmp_path / "log.wire").read_bytes() == before


def started(words: list[str], before: str) -> subprocess.Popen[str]:
    """Start the program, which handles signals by then; ``before`` is Python that it runs first."""
    code = f"import sys\n{before}\nfrom springmass.cli import main\nprint('begins', flush=True)\nsys.exit(main())"
    program = subprocess.Popen(
        [sys.executable, "-B", "-c", code, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=usual_signals,
    )
    assert program.stdout is not None
    assert program.stdout.readline() == "begins\n"
    return program


if __name__ == "__main__":
    work(Path(sys.argv[1]))
