"""The page beside a recording: a process of its own, whose only word here is a mark or a stop."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from pathlib import Path

from springmass.session.failures import Failures
from springmass.session.stops import Stops

__all__ = ["PAGE", "PageProcess"]

PAGE = "the page"
"""What ended a recording, where its page did."""
ENDS_WITHIN_S = 5.0


class PageProcess:
    """Starts the page on a log that is about to be begun; used in a ``with``.

    Whatever becomes of the page, the recording goes on: it reads the log from the disk, and its end is noted.

    Parameters
    ----------
    log : Path
    arguments : sequence of str
        Further options of ``springmass page``.
    marks : queue of str
        Takes the marks that are made on the page.
    stops : Stops
        Is told where the page asks for the end.
    failures : Failures
    """

    def __init__(
        self, log: Path, arguments: list[str], marks: queue.SimpleQueue[str], stops: Stops, failures: Failures
    ) -> None:
        self._command = [sys.executable, "-m", "springmass", "page", "--recorder", *arguments, "--", str(log)]
        self._marks, self._stops, self._failures = marks, stops, failures
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> PageProcess:
        try:
            # A session of its own: Ctrl-C is for the recording, which tells the page when it has ended.
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            self._failures.note("page", error)
            return self
        threading.Thread(target=self._listen, name="springmass-page", daemon=True).start()
        return self

    def ended(self) -> None:
        """Tell the page that the recording has ended; it shows that and ends, while the run file is built."""
        if self._process is not None:
            assert self._process.stdin is not None
            self._process.stdin.close()

    def __exit__(self, *_: object) -> None:
        """Return when the page has ended, or is ended."""
        if self._process is None:
            return
        self.ended()
        try:
            self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _listen(self) -> None:
        assert self._process is not None
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                said = json.loads(line)
                if said["type"] == "mark":
                    self._marks.put(str(said["text"]) or "mark")
                elif said["type"] == "stop":
                    self._stops.ask(PAGE)
            except (ValueError, KeyError, TypeError) as error:
                self._failures.note("page", error)
