"""The state of the page: the run that it shows, and the state that the recorder reported."""

from __future__ import annotations

import queue
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from springmass.page.feeds import LogFeed
from springmass.page.live_analysis import Watcher
from springmass.page.run_actions import Afterwards
from springmass.page.view import View

__all__ = ["AFTER", "BEFORE", "DURING", "Controls", "PageState"]

Controls = Callable[[Mapping[str, Any]], None]
"""Passes a request of the controller to the recorder, which acknowledges it."""
BEFORE = frozenset({"zero", "ruler", "arm", "disarm", "record", "close"})
DURING = frozenset({"mark", "note", "stop"})
AFTER = frozenset({"report", "note", "discard", "close"})
PHASES = {"ready": BEFORE, "still": frozenset[str](), "armed": BEFORE, "recording": DURING}
"""Requests that a recorder accepts in each phase."""


class PageState:
    """Holds the view, its watcher, and the state that the recorder reported.

    Parameters
    ----------
    wanted_u_s : float or None
        Standard uncertainty of the period to reach, s; None means 40 ppm of the period.
    controls : callable or None
        Passes requests to the recorder; None if there is none.
    law : str or None
        Stated damping law, as :func:`springmass.runs.analysing.with_law` takes it.

    Attributes
    ----------
    view : View or None
        The run that is shown; None before there is one.
    name : str
        Name of the run that will be recorded; empty if none is planned.
    closed : bool
        Whether somebody closed the page.
    bench : dict
        The last state of the recorder: its ``phase`` and the facts of this phase.
    """

    def __init__(
        self, wanted_u_s: float | None, controls: Controls | None = None, *, name: str = "", law: str | None = None
    ) -> None:
        self._wanted_u_s, self._law = wanted_u_s, law
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
        self._recorder_states: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()

    def show(self, view: View, scene: Mapping[str, Any] | None, path: Path | None = None) -> None:
        """Show a complete run; if its path is given, notes and a report are possible."""
        self._folder = None if path is None else path.parent
        self._lay(view, scene)
        if path is not None:
            self.after = Afterwards(path, ours=False, law=self._law)

    def follow(self, log: Path) -> None:
        """Show a growing log.

        Raises
        ------
        NotALog
            If the file is not a wire log.
        """
        feed = LogFeed(log)
        feed.view.name = self.name or feed.view.name
        if self._feed is not None:
            self._feed.close()
        self._feed, self._log, self._folder = feed, str(log), log.parent
        self._lay(feed.view, feed.scene)

    def put_recorder_state(self, message: Mapping[str, Any]) -> None:
        """Queue a state of the recorder; any thread may call this."""
        self._recorder_states.put(message)

    def poll(self) -> None:
        """Read new samples and states; only the server's thread may call this."""
        while not self._recorder_states.empty():
            self._take(self._recorder_states.get())
        if self._feed is not None:
            self._feed.poll()
            if self.view is not self._feed.view and self.after is None:
                self._lay(self._feed.view, self._feed.scene)
            if self.controls is None and self.view is not None and self.view.ended and self.watcher is not None:
                self.watcher.complete(Path(self._log))

    def state(self) -> dict[str, Any]:
        """Return the state of the run and its recorder."""
        state = {} if self.view is None else self.view.state()
        zero = {} if self.view is None else self.view.zero
        after = {} if self.after is None else self.after.state()
        return {**state, "bench": {**zero, **self.bench, **after}, "disk_free_bytes": self._free()}

    def may(self, kind: str) -> bool:
        """Return whether a request is possible now."""
        if self.after is not None:
            return kind in AFTER and (kind != "discard" or self.after.ours) and (kind != "close" or self.after.ours)
        return self.controls is not None and kind in PHASES.get(self.bench["phase"], frozenset())

    def close(self) -> None:
        """Close the log and end the analysis."""
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
            except Exception as error:  # the recording goes on, even if the page cannot show it
                self.bench["said"] = f"it cannot be shown ({error})"
        if message["phase"] == "built":
            self.after = Afterwards(Path(message["run"]), ours=True, law=self._law)
            if self.watcher is not None:
                self.watcher.complete(Path(message["run"]))

    def _lay(self, view: View, scene: Mapping[str, Any] | None) -> None:
        if self.watcher is not None:
            self.watcher.close()
        self.view = view
        self.watcher = Watcher(view, scene, self._wanted_u_s, self._law)

    def _free(self) -> int | None:
        try:
            return None if self._folder is None else shutil.disk_usage(self._folder).free
        except OSError:  # the folder was renamed; the recorder reports that
            return None
