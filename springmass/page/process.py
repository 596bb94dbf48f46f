"""The page beside a recording: a process of its own, between which and the recorder a line goes now and then.

What the recorder says of itself goes to the page through a thread that alone may wait for it; what is asked on the page
comes through another. Neither can delay a reading, and a page that dies is started again, under the same address.
"""

from __future__ import annotations

import contextlib
import json
import queue
import secrets
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from springmass.session.failures import Failures
from springmass.session.stops import Stops

__all__ = ["PAGE", "PageProcess"]

PAGE = "the page"
"""What ended a recording, where its page did."""
ENDS_WITHIN_S = 5.0
STARTS = 5
"""So often a page that died is started again; one that dies more often has a defect that starting does not mend."""
MOST_UNREAD = 100
"""So many words of the recorder wait for a page that reads none; the last ones count."""


class PageProcess:
    """Starts the page; used in a ``with``.

    Whatever becomes of the page, the recording goes on: it reads the log from the disk, and its end is noted.

    Parameters
    ----------
    arguments : sequence of str
        Options of ``springmass page``.
    log : Path
        The log that will be recorded to; the page names the run by it.
    marks : queue of str
        Takes the marks that are made on the page.
    stops : Stops
        Is told where the page asks for the end of the recording.
    failures : Failures

    Attributes
    ----------
    marks : queue of str
        May be changed before the recording begins.
    asked : queue of dict
        What else was asked for on the page.
    """

    def __init__(
        self, arguments: list[str], log: Path, marks: queue.SimpleQueue[str], stops: Stops, failures: Failures
    ) -> None:
        self._arguments, self._log = arguments, str(log)
        self.marks, self._stops, self._failures = marks, stops, failures
        self.asked: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._words: queue.SimpleQueue[Mapping[str, Any] | None] = queue.SimpleQueue()
        self._last: Mapping[str, Any] = {"phase": "waiting"}
        self._gate: dict[str, Any] = {"secret": secrets.token_urlsafe(24), "port": None}
        self._over = False
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._kept = threading.Thread(target=self._keep, name="springmass-page", daemon=True)

    def __enter__(self) -> PageProcess:
        self._kept.start()
        threading.Thread(target=self._speak, name="springmass-page-words", daemon=True).start()
        return self

    def tell(self, phase: str, **facts: Any) -> None:
        """Say where the recording stands; never waits."""
        if self._words.qsize() < MOST_UNREAD:
            self._words.put({"phase": phase, **facts})

    def ended(self) -> None:
        """Tell the page that no more will be said; it shows that and ends."""
        with self._lock:
            self._over = True
        self._words.put(None)

    def attend(self) -> None:
        """Return when the page has ended of its own: somebody closed it, or nobody looks any more."""
        with self._lock:
            self._over = True
        self._kept.join()

    def __exit__(self, *_: object) -> None:
        """Return when the page has ended, or is ended."""
        self.ended()
        self._kept.join(ENDS_WITHIN_S)
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def _keep(self) -> None:
        """Run the page, and run it again where it died before its time."""
        for _ in range(STARTS):
            try:
                # A session of its own: Ctrl-C is for the recording, which tells the page when it has ended.
                command = [sys.executable, "-m", "springmass", "page", "--recorder", *self._arguments, "--", self._log]
                process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:
                self._failures.note("page", error)
                return
            self._process = process
            self._words.put({"gate": dict(self._gate)})
            self._words.put(self._last)
            self._listen(process)
            code = process.wait()
            with self._lock:
                if self._over or code == 0:
                    return
            self._failures.note("page", RuntimeError(f"the page's process ended with {code}; it is started again"))

    def _speak(self) -> None:
        while (word := self._words.get()) is not None:
            if "phase" in word:
                self._last = word
            self._write(json.dumps(word))
        if self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def _write(self, line: str) -> None:
        """Write to the page that runs now; one that is gone misses nothing, for the next is told anew."""
        process = self._process
        if process is None or process.stdin is None:
            return
        with contextlib.suppress(OSError, ValueError):
            process.stdin.write(line.encode() + b"\n")
            process.stdin.flush()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            try:
                said = json.loads(line)
                kind = said["type"]
                if kind == "open":
                    self._gate["port"] = int(said["port"])
                elif kind == "used":
                    self._gate["used"] = True
                elif kind == "mark":
                    self.marks.put(str(said["text"]) or "mark")
                elif kind == "note":
                    self._note(str(said["text"]))
                elif kind == "stop":
                    self._stops.ask(PAGE)
                else:
                    self.asked.put(said)
            except (ValueError, KeyError, TypeError) as error:
                self._failures.note("page", error)

    def _note(self, text: str) -> None:
        """Put a note into the log, as an event; before and after the recording there is no log to put it into."""
        if text and (tell := self._failures.tell) is not None:
            tell("note", {"text": text})
