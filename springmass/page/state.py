"""The state of the page: the run that it shows, what the recorder reported, and actions on a recorded run."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from springmass.loading.notes import about_of, about_path, write_about
from springmass.page.feeds import LogFeed
from springmass.page.live_analysis import Watcher
from springmass.page.view import View
from springmass.result.output_names import results_name
from springmass.session.live_state import free_bytes

ASIDE = "discarded"
"""Folder next to the runs for discarded runs."""


class RunActions:
    """Works on one run; its path comes from the recorder or the command line, never from the network.

    ``ours`` is whether the run was recorded just now; no other run can be discarded. ``report`` is the path of the
    report; None until it is made. ``words`` are the options of ``springmass analyse`` with which it is made, and
    ``chosen`` has the run and the channel among them.
    """

    def __init__(self, run: Path, *, ours: bool, words: Sequence[str], chosen: Mapping[str, str] | None = None) -> None:
        self._run, self.ours, self._words, self._chosen = run, ours, words, chosen or {}
        self.report: Path | None = None
        self._making = False
        self._notes: list[str] = []
        self.discarded = self._failed = ""  # where the run was moved, and why an action failed

    def state(self) -> dict[str, Any]:
        """Return the state of the actions for the page."""
        report = "making" if self._making else "" if self.report is None else "ready"
        return {"report": report, "noted": self._notes, "discarded": self.discarded, "failed": self._failed}

    def note(self, text: str) -> None:
        """Add a note to the file next to the run."""
        try:
            write_about(about_of(self._run).with_more(None, (text,), ()))
            self._notes = [*self._notes, text]
        except Exception as error:
            self._failed = f"not noted ({error})"

    def discard(self) -> None:
        """Move the run and its notes to the folder of discarded runs, without replacing any file there."""
        if self._making or self.discarded:
            return
        folder = self._run.parent / ASIDE
        try:
            folder.mkdir(exist_ok=True)
            number, name = 1, self._run.name
            while (folder / name).exists():
                number += 1
                name = f"{self._run.stem}-{number}{self._run.suffix}"
            notes, aside = about_of(self._run).path, folder / name
            self._run.rename(aside)
            if notes.exists():
                notes.rename(about_path(aside))
            self._run, self.discarded = aside, f"{ASIDE}/{name}"
        except OSError as error:
            self._failed = f"not set aside ({error.strerror or error})"

    def make_report(self) -> None:
        """Start a process that analyses the run, unless one is already running."""
        if not self._making:
            self._making, self._failed, self.report = True, "", None
            threading.Thread(target=self._analyse, name="springmass-page-report", daemon=True).start()

    def _analyse(self) -> None:
        run = self._run
        command = [sys.executable, "-m", "springmass", "-q", "analyse", f"--output={run.parent}"]
        command += [*self._words, "--", str(run)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, errors="replace")
            page = run.parent / results_name(run, **self._chosen) / "report.html"
            if done.returncode == 0 and page.is_file():
                self.report = page
            else:
                lines = done.stderr.strip().splitlines()
                self._failed = f"no report ({lines[-1] if lines else f'exit code {done.returncode}'})"
        except OSError as error:
            self._failed = f"no report ({error})"
        finally:
            self._making = False


Limits = tuple[float, float]
ANY_TIME: Limits = (-1e12, 1e12)
REQUESTS: Mapping[str, tuple[Mapping[str, Limits | None], tuple[str, ...]]] = {
    "region": ({"from": ANY_TIME, "to": ANY_TIME}, ()),
    "zero": ({}, ("ready",)),
    "arm": ({"threshold_m": (1e-4, 1.0), "keep_s": (0.0, 60.0)}, ("ready", "armed")),
    "disarm": ({}, ("armed",)),
    "record": ({}, ("ready", "armed")),
    "mark": ({"text": None}, ("recording",)),
    "note": ({"text": None}, ("recording", "built", "replay")),
    "stop": ({}, ("recording",)),
    "report": ({}, ("built", "replay")),
    "discard": ({}, ("built",)),
    "close": ({}, ("ready", "armed", "built")),
}
"""Requests with the limits of their numbers, in m and s, None for a text, and the phases in which a controller may send
them. Any viewer may ask for a region at any time."""


class PageState:
    """Holds the view, its watcher, and ``bench``: the recorder's phase and the facts of this phase.

    ``controls`` passes requests to the recorder, if there is one; ``name`` is that of the run that will be recorded.
    ``words_of`` words options of reading and analysing for a command line. ``closed`` is whether somebody closed the
    page. None wants u(T) to reach 40 ppm of the period.
    """

    def __init__(
        self,
        wanted_u_s: float | None,
        controls: Callable[[Mapping[str, Any]], None] | None = None,
        *,
        words_of: Callable[[Mapping[str, object]], list[str]],
        name: str = "",
        law: str | None = None,
    ) -> None:
        self._wanted_u_s, self.controls, self._name, self._law = wanted_u_s, controls, name, law
        self._words_of = words_of
        self.closed = False
        self.view: View | None = None
        self.watcher: Watcher | None = None
        self.bench: dict[str, Any] = {"phase": "replay" if controls is None else "waiting"}
        self.after: RunActions | None = None
        self._feed: LogFeed | None = None
        self._log: Path | None = None
        self._folder: Path | None = None
        self.recorder_states: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()

    def show(self, view: View, path: Path, read: Mapping[str, Any]) -> None:
        """Show a complete run, which was read with these options."""
        self._folder = path.parent
        self._lay(view)
        chosen = {name: str(read[name]) for name in ("run", "channel") if name in read}
        self.after = RunActions(path, ours=False, words=self._words_of({**read, "law": self._law}), chosen=chosen)

    def follow(self, log: Path) -> None:
        """Show a growing log; raises NotALog if the file is not a wire log."""
        feed = LogFeed(log)
        feed.view.name = self._name or feed.view.name
        if self._feed is not None:
            self._feed.close()
        self._feed, self._log, self._folder = feed, log, log.parent
        self._lay(feed.view)

    def poll(self) -> None:
        """Read new samples and states; only the server's thread may call this."""
        while not self.recorder_states.empty():
            self._take(self.recorder_states.get())
        if self._feed is None or self._log is None:
            return
        self._feed.poll()
        if self.view is not self._feed.view and self.after is None:
            self._lay(self._feed.view)
        if self.controls is None and self._feed.view.ended and self.watcher is not None:
            self.watcher.complete(self._log)

    def state(self) -> dict[str, Any]:
        """Return the state of the run and its recorder."""
        state = {"type": "state"} if self.view is None else self.view.state()
        zero = {} if self.view is None else self.view.zero
        after = {} if self.after is None else self.after.state()
        free = None if self._folder is None else free_bytes(self._folder)
        bench = {**zero, **self.bench, **after, "requests": self.requests()}
        return {**state, "bench": bench, "disk_free_bytes": free}

    def requests(self) -> list[str]:
        """Return the requests of a controller that are possible now."""
        phase, after = self.bench["phase"], self.after
        if phase == "replay" and after is None:  # a log that another program records
            return []
        possible = [name for name, (_, phases) in REQUESTS.items() if phase in phases]
        return [name for name in possible if name != "discard" or after is None or not after.discarded]

    def ask(self, request: Mapping[str, Any]) -> None:
        """Carry out a controller's request that is possible now, and ignore others; the page shows the state."""
        kind, after = request["type"], self.after
        if kind not in self.requests():
            return
        if after is None:
            if self.controls is not None:
                self.controls(request)
        elif kind == "report":
            after.make_report()
        elif kind == "note":
            after.note(request["text"])
        elif kind == "discard":
            after.discard()
        elif kind == "close":
            self.closed = True

    def close(self) -> None:
        """Close the log and end the analysis."""
        if self.watcher is not None:
            self.watcher.close()
        if self._feed is not None:
            self._feed.close()

    def _take(self, message: Mapping[str, Any]) -> None:
        self.bench = dict(message)
        log = message.get("log")
        if log and Path(log) != self._log:
            try:
                self.follow(Path(log))
            except Exception as error:  # the recording goes on, even if the page cannot show it
                self.bench["said"] = f"it cannot be shown ({error})"
        if message["phase"] == "built":
            self.after = RunActions(Path(message["run"]), ours=True, words=self._words_of({"law": self._law}))
            if self.watcher is not None:
                self.watcher.complete(Path(message["run"]))

    def _lay(self, view: View) -> None:
        if self.watcher is not None:
            self.watcher.close()
        self.view = view
        self.watcher = Watcher(view, self._wanted_u_s, self._law)
