"""The page during a recording: a separate process to which the recorder writes lines.

One thread writes the recorder's state to the page, and only that thread may wait for the page. Another thread reads the
requests of the page. Neither can delay a reading.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shlex
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from acquisition.events import Noted
from springmass.session.failures import Failures
from springmass.session.session import Marks
from springmass.stops import EndReason, Stops

ENDS_WITHIN_S = 5.0
OF_RECORDER = "SPRINGMASS_PAGE_OF_RECORDER"
"""The variable of the environment that tells the process of a page that a recorder speaks to it on stdin."""


class PageProcess:
    """The process of ``springmass page``, as a context manager; the recording goes on if it ends early.

    ``arguments`` are its options, ``log`` is the log of the future recording, from which it derives the name of the
    run. ``marks`` receives the marks and notes of viewers, and ``requests`` their other requests. ``say`` prints lines
    on the terminal.
    """

    def __init__(
        self,
        arguments: list[str],
        log: Path,
        marks: Marks,
        stops: Stops,
        failures: Failures,
        say: Callable[[str], None],
    ) -> None:
        self._log, self._marks, self._stops, self._failures, self._say = log, marks, stops, failures, say
        self._command = [sys.executable, "-m", "springmass", "page", *arguments, "--", str(log)]
        self.requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._lines: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._phase = "waiting"
        self._over = False
        self.failed = False  # the process died; False if somebody closed the page
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> PageProcess:
        try:
            # In a separate session, because Ctrl-C is meant for the recording, which ends the page later.
            pipe = subprocess.PIPE
            environment = {**os.environ, OF_RECORDER: "1"}
            self._process = subprocess.Popen(
                self._command, stdin=pipe, stdout=pipe, start_new_session=True, env=environment
            )
        except OSError as error:
            self._lost(error)
            return self
        self._listener = threading.Thread(
            target=self._listen, args=(self._process,), name="springmass-page", daemon=True
        )
        self._listener.start()
        writing = (self._process.stdin,)
        threading.Thread(target=self._write, args=writing, name="springmass-page-states", daemon=True).start()
        return self

    def tell(self, phase: str, **facts: Any) -> None:
        """Send the phase of the recording to the page without waiting."""
        self._phase = phase
        self._lines.put({"phase": phase, **facts})

    def ended(self) -> None:
        """Close the input of the page, which then shows the end of the recording and exits."""
        self._over = True
        self._lines.put(None)

    def attend(self) -> None:
        """Wait until the page has ended because somebody closed it or nobody views it any more."""
        self._over = True
        if self._process is not None:
            self._listener.join()

    def __exit__(self, *_: object) -> None:
        """Wait until the page has ended, and kill it if it does not end in time."""
        self.ended()
        if self._process is not None:
            self._listener.join(ENDS_WITHIN_S)
            self._process.kill()
            self._process.wait()

    def _write(self, page: IO[bytes]) -> None:
        with contextlib.suppress(OSError), page:  # an error means that the page has ended
            while (line := self._lines.get()) is not None:
                page.write(json.dumps(line).encode() + b"\n")
                page.flush()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                try:
                    self._take(json.loads(line))
                except (ValueError, KeyError, TypeError) as error:
                    self._failures.note("page", error)
        code = process.wait()
        if not self._over:
            self._lost(ChildProcessError(f"its process ended with {code}"))

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "stop":
            self._stops.ask(EndReason.PAGE)
        elif kind == "mark":
            self._marks.put(message["text"] or "mark")
        elif kind == "note":
            if message["text"]:
                self._marks.put(Noted(text=message["text"]))
        elif kind == "line":
            self._say(message["text"])
        else:
            self.requests.put(message)

    def _lost(self, error: Exception) -> None:
        """Say that the page has ended, and how to open it again."""
        self._failures.note("page", error)
        again = shlex.join(["springmass", "page", str(self._log)])
        advice = f"the recording goes on until Ctrl-C, and `{again}` shows it"
        if self._phase in ("ready", "still"):
            advice = "nothing has been recorded; start `springmass record` again"
        self._say(f"springmass: the page has ended ({error}); {advice}")
        self.failed = True
