"""A sensor that shares no code with the decoders, a recording of it in a separate process, and a time limit."""

import contextlib
import os
import pty
import resource
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any, Self

import numpy as np
import pytest

from storage.run_file.reading import open_run
from tests.encoders import sealed, with_sum

RATE_HZ = 100.0
FIRST_US, STEP_US = 1000.0, 0.25
SPEED_M_PER_S = 344.0
LIMIT_S = 180.0
Send = Callable[[int], bytes]
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def line_of(number: int) -> bytes:
    """Return a reading whose echo time encodes its number, in the form of docs/reference/line-protocol.md."""
    return sealed(f"R1,{number},{number * 10_000},{FIRST_US + STEP_US * number:.2f},2000,E")


def frame_of(millimetres: int) -> bytes:
    """Return four bytes of an A02YYUW: header, millimetres, sum."""
    return with_sum(bytes([0xFF, *divmod(millimetres, 256)]))


def usual_signals() -> None:
    """Give the signals their usual effect: a child inherits what the caller of the tests ignores."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Let no file grow beyond so many bytes: a disk that is full for this process."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


class Sensor:
    """Writes to a descriptor at a fixed rate, or once for each request, until it is stopped; it may wait for a byte."""

    def __init__(self, descriptor: int, send: Send, *, polled: bool = False, waits: bool = False) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor, self._send, self._polled, self._waits = descriptor, send, polled, waits
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while self._waits and not self._stop.is_set():
            self._waits = not select.select([self._descriptor], [], [], 0.1)[0]
        start, number = time.monotonic(), 0
        while not self._stop.wait(0.002 if self._polled else max(0.0, start + number / RATE_HZ - time.monotonic())):
            with contextlib.suppress(OSError):  # nobody reads: a sensor's bytes are lost then
                for _ in range(len(os.read(self._descriptor, 100)) if self._polled else 1):
                    os.write(self._descriptor, self._send(number))
                    number += 1


@contextmanager
def on_a_terminal(send: Send, **how: bool) -> Iterator[str]:
    """Yield the name of a port on which a sensor sends."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    sensor = Sensor(master, send, **how)
    try:
        yield os.ttyname(slave)
    finally:
        sensor.stop()
        os.close(slave)
        os.close(master)


@contextmanager
def on_a_socket(send: Send) -> Iterator[str]:
    """Yield the address of a server whose first connection gets what a sensor sends."""
    sensors = []
    with socket.create_server(("127.0.0.1", 0)) as listener, contextlib.ExitStack() as stack:
        listener.settimeout(LIMIT_S)

        def serve() -> None:
            connection = stack.enter_context(listener.accept()[0])
            sensors.append(Sensor(connection.fileno(), send))

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}"
        thread.join()
        for sensor in sensors:
            sensor.stop()


class Feeder:
    """Sends a hundred readings a second to a port of this name in ``folder`` until it is stopped or unplugged."""

    def __init__(self, folder: Path) -> None:
        self.port, self.sent = folder / "port", 0
        self._mute, self._plugged = False, contextlib.ExitStack()
        self.port.symlink_to(self._plugged.enter_context(on_a_terminal(self._line)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def mute(self) -> None:
        """Send nothing more, the cable still in."""
        self._mute = True

    def unplug(self) -> None:
        """Take the port away."""
        self.port.unlink(missing_ok=True)
        self._plugged.close()

    def _line(self, number: int) -> bytes:
        self.sent = number
        return b"" if self._mute else line_of(number)


@dataclass
class Recording:
    """A recording process: its end is awaited, never slept for."""

    process: subprocess.Popen[bytes]
    out: Path

    @property
    def log(self) -> Path:
        """The wire log."""
        return self.out.with_suffix(".wire")

    def until_bytes(self, size: int) -> None:
        """Return once the log holds so much."""
        self.until(lambda: self.log.exists() and self.log.stat().st_size >= size)

    def until(self, holds: Callable[[], bool]) -> None:
        """Return once something holds of what is recorded."""
        end = time.monotonic() + LIMIT_S
        while not holds():
            assert self.process.poll() is None, f"ended with {self.process.returncode}"
            assert time.monotonic() < end, "nothing is recorded"
            threading.Event().wait(0.02)

    def said(self) -> str:
        """Return what is said on stderr until the process ends, which is never a traceback."""
        assert self.process.stderr is not None
        output = self.process.stderr.read().decode()
        assert "Traceback" not in output
        return output

    def ended(self, limit_s: float = LIMIT_S) -> int:
        """Wait for the end; return the exit code."""
        return self.process.wait(limit_s)


def start_recording(
    port: object,
    out: Path,
    *arguments: str,
    before: str = "",
    stderr: Any = subprocess.DEVNULL,
    prepare: Callable[[], None] | None = None,
) -> Recording:
    """Start ``springmass record`` as a process; ``before`` is Python that it runs first."""
    code = f"{before}\nimport sys\nfrom springmass.cli import main\nsys.exit(main(sys.argv[1:]))"
    command = ["record", "--port", str(port), "--sensor", "line-protocol", "-o", str(out), *arguments]
    process = subprocess.Popen(
        [sys.executable, "-B", "-c", code, *command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        preexec_fn=prepare,
    )
    return Recording(process, out)


def numbers_of(run_file: Path) -> list[int]:
    """Return the numbers of the readings that a run file holds, and fail where a value is none that was sent."""
    with open_run(run_file) as run:
        run.verify()
        distance = run.samples().distance
    steps = (2e6 * distance[np.isfinite(distance)] / SPEED_M_PER_S - FIRST_US) / STEP_US
    whole = np.rint(steps)
    assert np.abs(steps - whole).max(initial=0.0) < 1e-6, "a value that nobody sent"
    return [int(number) for number in whole]


def whole_numbers_of(run_file: Path) -> list[int]:
    """Return the numbers, and fail where a reading between the first and the last is missing or out of order."""
    numbers = numbers_of(run_file)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "readings are missing"
    return numbers


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Any]:
    """Give a feeder and recordings; no process outlives the test."""
    started: list[Recording] = []

    def record(*arguments: Any, **options: Any) -> Recording:
        started.append(start_recording(*arguments, **options))
        return started[-1]

    yield SimpleNamespace(feeder=lambda: Feeder(tmp_path), record=record)
    for recording in started:
        if recording.process.poll() is None:
            recording.process.kill()
            recording.process.wait()
        if recording.process.stderr is not None:
            recording.process.stderr.close()


@pytest.fixture
def answer_within() -> Callable[[int], AbstractContextManager[None]]:
    """Return a context that raises TimeoutError where its body works three times so many seconds, or waits thirty.

    Processor time tells work from a machine that is busy, and the factor a slow one; what waits for ever uses none.
    """

    @contextmanager
    def within(seconds: int) -> Iterator[None]:
        def late(_: int, __: FrameType | None) -> None:
            raise TimeoutError(f"no answer within {seconds} s")

        before = [signal.signal(each, late) for each in (signal.SIGALRM, signal.SIGPROF)]
        signal.setitimer(signal.ITIMER_PROF, 3 * seconds)
        signal.alarm(30 * seconds)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.alarm(0)
            for each, handler in zip((signal.SIGALRM, signal.SIGPROF), before, strict=True):
                signal.signal(each, handler)

    return within
