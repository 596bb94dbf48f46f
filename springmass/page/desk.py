"""What lies before those who look: one run at a time, and where its recorder stands, as the recorder has said."""

from __future__ import annotations

import queue
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from springmass.page.afterwards import Afterwards
from springmass.page.feeds import LogFeed
from springmass.page.view import View
from springmass.page.watching import Watcher

__all__ = ["AFTER", "BEFORE", "DURING", "Controls", "Desk"]

Controls = Callable[[Mapping[str, Any]], None]
"""Takes what the controller asked for, to the recorder, which acknowledges it."""
BEFORE = frozenset({"zero", "ruler", "arm", "disarm", "record", "close"})
DURING = frozenset({"mark", "note", "stop"})
AFTER = frozenset({"report", "note", "discard", "close"})
PHASES = {"ready": BEFORE, "still": frozenset[str](), "armed": BEFORE, "recording": DURING}
"""What may be asked of a recorder that has said where it stands."""


class Desk:
    """Holds the view, its watcher, and the recorder's word.

    Parameters
    ----------
    wanted_u_s : float or None
        Of the period, s; None: 40 ppm of it.
    controls : callable or None
        To the recorder; None where there is none.

    Attributes
    ----------
    view : View or None
        None before there is anything to show.
    name : str
        Of the run to come.
    closed : bool
        Whether somebody closed the page.
    bench : dict
        What the recorder said last: its ``phase`` and what belongs to it.
    """

    def __init__(self, wanted_u_s: float | None, controls: Controls | None = None, *, name: str = "") -> None:
        self._wanted_u_s = wanted_u_s
        self.controls = controls
        self.name = name
        self.closed = False
        self.view: View | None = None
        self.watcher: Watcher | None = None
        self.bench: dict[str, Any] = {"phase": "replay" if controls is None else "waiting"}
        self.after: Afterwards | None = None
        self._feed: LogFeed | None = None
        self._log = ""
        self._folder: Path | None = None
        self._said: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()

    def show(self, view: View, scene: Mapping[str, Any] | None, path: Path | None = None) -> None:
        """Show a run that is all there; with its path, notes and a report can be made of it."""
        self._folder = None if path is None else path.parent
        self._lay(view, scene)
        if path is not None:
            self.after = Afterwards(path, ours=False)

    def follow(self, log: Path) -> None:
        """Show a log that grows.

        Raises
        ------
        NotALog
            If it is none.
        """
        feed = LogFeed(log)
        feed.view.name = self.name or feed.view.name
        if self._feed is not None:
            self._feed.close()
        self._feed, self._log, self._folder = feed, str(log), log.parent
        self._lay(feed.view, feed.scene)

    def told(self, message: Mapping[str, Any]) -> None:
        """Take the recorder's word, from any thread."""
        self._said.put(message)

    def poll(self) -> None:
        """Bring everything up to date; called on the server's thread alone."""
        while not self._said.empty():
            self._take(self._said.get())
        if self._feed is not None:
            self._feed.poll()

    def state(self) -> dict[str, Any]:
        """Return where the run and its recorder stand."""
        state = {} if self.view is None else self.view.state()
        after = {} if self.after is None else self.after.state()
        return {**state, "bench": {**self.bench, **after}, "disk_free_bytes": self._free()}

    def may(self, kind: str) -> bool:
        """Tell whether something may be asked now."""
        if self.after is not None:
            return kind in AFTER and (kind != "discard" or self.after.ours) and (kind != "close" or self.after.ours)
        return self.controls is not None and kind in PHASES.get(self.bench["phase"], frozenset())

    def close(self) -> None:
        """Let go of the log and of the analysis."""
        if self.watcher is not None:
            self.watcher.close()
        if self._feed is not None:
            self._feed.close()

    def _take(self, message: Mapping[str, Any]) -> None:
        self.bench = dict(message)
        log = str(message.get("log", ""))
        if log and log != self._log:
            try:
                self.follow(Path(log))
            except Exception as error:  # the recording goes on, whatever keeps the page from showing it
                self.bench["said"] = f"it cannot be shown ({error})"
        if message["phase"] == "built":
            self.after = Afterwards(Path(message["run"]), ours=True)

    def _lay(self, view: View, scene: Mapping[str, Any] | None) -> None:
        if self.watcher is not None:
            self.watcher.close()
        self.view = view
        self.watcher = Watcher(view, scene, self._wanted_u_s)

    def _free(self) -> int | None:
        try:
            return None if self._folder is None else shutil.disk_usage(self._folder).free
        except OSError:  # a folder that was renamed; the recorder says so
            return None
