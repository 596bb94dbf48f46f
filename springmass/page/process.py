"""The page during a recording: a separate process to which the recorder writes lines.

One thread writes the recorder's state to the page, and only that thread may wait for the page. Another thread reads the
requests of the page. Neither can delay a reading. A page that dies is started again under the same address.
"""

from __future__ import annotations

import contextlib
import json
import queue
import secrets
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from springmass.session.failures import Failures
from springmass.stops import EndReason, Stops

__all__ = ["PageProcess"]

ENDS_WITHIN_S = 5.0
STARTS = 5
"""Maximum number of starts of the page; a page that dies more often has a defect."""
MOST_UNREAD = 100
"""Maximum number of lines that wait for a page that reads none; further lines are dropped."""


class PageProcess:
    """Starts and ends the page, as a context manager.

    The recording goes on even if the page dies; the page's death is recorded as a failure.

    Parameters
    ----------
    arguments : sequence of str
        Options of ``springmass page``.
    log : Path
        The log of the future recording; the page derives the name of the run from it.
    marks : queue of str
        Receives the marks that are set on the page.
    stops : Stops
        Receives the page's request to end the recording.
    failures : Failures
    say : callable
        Receives lines of the page for the terminal, such as its address.

    Attributes
    ----------
    marks : queue of str
        Receives the marks; it may be replaced before the recording begins.
    requests : queue of dict
        Receives the other requests of the page.
    """

    def __init__(
        self,
        arguments: list[str],
        log: Path,
        marks: queue.SimpleQueue[str],
        stops: Stops,
        failures: Failures,
        say: Callable[[str], None],
    ) -> None:
        self._arguments, self._log, self._say = arguments, str(log), say
        self.marks, self._stops, self._failures = marks, stops, failures
        self.requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._states: queue.SimpleQueue[Mapping[str, Any] | None] = queue.SimpleQueue()
        self._last: Mapping[str, Any] = {"phase": "waiting"}
        self._gate: dict[str, Any] = {"secret": secrets.token_urlsafe(24), "port": None}
        self._over = False
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._kept = threading.Thread(target=self._keep, name="springmass-page", daemon=True)

    def __enter__(self) -> PageProcess:
        self._kept.start()
        threading.Thread(target=self._write_states, name="springmass-page-states", daemon=True).start()
        return self

    def tell(self, phase: str, **facts: Any) -> None:
        """Send the phase of the recording to the page without waiting."""
        if self._states.qsize() < MOST_UNREAD:
            self._states.put({"phase": phase, **facts})

    def ended(self) -> None:
        """Close the input of the page, which then shows the end of the recording and exits."""
        with self._lock:
            self._over = True
        self._states.put(None)

    def attend(self) -> None:
        """Wait until the page has ended because somebody closed it or nobody views it any more."""
        with self._lock:
            self._over = True
        self._kept.join()

    def __exit__(self, *_: object) -> None:
        """Wait until the page has ended, and kill it if it does not end in time."""
        self.ended()
        self._kept.join(ENDS_WITHIN_S)
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def _keep(self) -> None:
        """Run the page, and run it again if it died early."""
        for _ in range(STARTS):
            try:
                # In a separate session, because Ctrl-C is meant for the recording, which ends the page later.
                command = [sys.executable, "-m", "springmass", "page", "--recorder", *self._arguments, "--", self._log]
                process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:
                self._failures.note("page", error)
                return
            # The gate must be the page's first line, so it is written before the writing thread can access the process.
            _write(process, {"gate": self._gate})
            self._process = process
            self._states.put({})  # nothing new: the last state is for the page that has just been started
            self._listen(process)
            code = process.wait()
            with self._lock:
                if self._over or code == 0:
                    return
            self._failures.note("page", RuntimeError(f"the page's process ended with {code}; it is started again"))

    def _write_states(self) -> None:
        while (state := self._states.get()) is not None:
            if state:
                self._last = state
            if self._process is not None:
                _write(self._process, self._last)
        if self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            try:
                message = json.loads(line)
                kind = message["type"]
                if kind == "open":
                    self._gate["port"] = int(message["port"])
                elif kind == "used":
                    self._gate["used"] = True
                elif kind == "line":
                    self._say(str(message["text"]))
                elif kind == "mark":
                    self.marks.put(str(message["text"]) or "mark")
                elif kind == "note":
                    self._note(str(message["text"]))
                elif kind == "stop":
                    self._stops.ask(EndReason.PAGE)
                else:
                    self.requests.put(message)
            except (ValueError, KeyError, TypeError) as error:
                self._failures.note("page", error)

    def _note(self, text: str) -> None:
        """Write a note to the log as an event; a log exists only during the recording."""
        if text and (tell := self._failures.tell) is not None:
            tell("note", {"text": text})


def _write(process: subprocess.Popen[bytes], content: Mapping[str, Any]) -> None:
    """Write one line to a page; if that page has ended, its successor gets the last state when it starts."""
    if process.stdin is None:
        return
    with contextlib.suppress(OSError, ValueError):
        process.stdin.write(json.dumps(content).encode() + b"\n")
        process.stdin.flush()
