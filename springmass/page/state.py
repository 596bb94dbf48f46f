"""The state of the page: the run that it shows, and the state that the recorder reported."""

from __future__ import annotations

import queue
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from springmass.page.feeds import LogFeed
from springmass.page.live_analysis import Watcher
from springmass.page.run_actions import RunActions
from springmass.page.view import View
from springmass.session.progress import free_bytes

POSSIBLE: Mapping[str, tuple[str, ...]] = {
    "ready": ("zero", "arm", "record", "close"),
    "armed": ("arm", "disarm", "record", "close"),
    "recording": ("mark", "note", "stop"),
}
"""Requests that a recorder accepts in each phase."""


class PageState:
    """Holds the view, its watcher, and ``bench``: the recorder's phase and the facts of this phase.

    ``controls`` passes requests to the recorder, if there is one; ``name`` is that of the run that will be recorded.
    ``closed`` is whether somebody closed the page. None wants u(T) to reach 40 ppm of the period.
    """

    def __init__(
        self,
        wanted_u_s: float | None,
        controls: Callable[[Mapping[str, Any]], None] | None = None,
        *,
        name: str = "",
        law: str | None = None,
    ) -> None:
        self._wanted_u_s, self.controls, self._name, self._law = wanted_u_s, controls, name, law
        self.closed = False
        self.view: View | None = None
        self.watcher: Watcher | None = None
        self.bench: dict[str, Any] = {"phase": "replay" if controls is None else "waiting"}
        self.after: RunActions | None = None
        self._feed: LogFeed | None = None
        self._log: Path | None = None
        self._folder: Path | None = None
        self.recorder_states: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()

    def show(self, view: View, scene: Mapping[str, Any] | None, path: Path) -> None:
        """Show a complete run."""
        self._folder = path.parent
        self._lay(view, scene)
        self.after = RunActions(path, ours=False, law=self._law)

    def follow(self, log: Path) -> None:
        """Show a growing log; raises NotALog if the file is not a wire log."""
        feed = LogFeed(log)
        feed.view.name = self._name or feed.view.name
        if self._feed is not None:
            self._feed.close()
        self._feed, self._log, self._folder = feed, log, log.parent
        self._lay(feed.view, feed.scene)

    def poll(self) -> None:
        """Read new samples and states; only the server's thread may call this."""
        while not self.recorder_states.empty():
            self._take(self.recorder_states.get())
        if self._feed is None or self._log is None:
            return
        self._feed.poll()
        if self.view is not self._feed.view and self.after is None:
            self._lay(self._feed.view, self._feed.scene)
        if self.controls is None and self._feed.view.ended and self.watcher is not None:
            self.watcher.complete(self._log)

    def state(self) -> dict[str, Any]:
        """Return the state of the run and its recorder."""
        state = {"type": "state"} if self.view is None else self.view.state()
        zero = {} if self.view is None else self.view.zero
        after = {} if self.after is None else self.after.state()
        free = None if self._folder is None else free_bytes(self._folder)
        return {**state, "bench": {**zero, **self.bench, **after}, "disk_free_bytes": free}

    def ask(self, request: Mapping[str, Any]) -> None:
        """Carry out a controller's request that is possible now, and ignore others; the page shows the state."""
        kind, after = request["type"], self.after
        if after is None:
            if self.controls is not None and kind in POSSIBLE.get(self.bench["phase"], ()):
                self.controls(request)
        elif kind == "report":
            after.make_report()
        elif kind == "note":
            after.note(request["text"])
        elif kind == "discard" and after.ours:
            after.discard()
        elif kind == "close" and after.ours:
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
            self.after = RunActions(Path(message["run"]), ours=True, law=self._law)
            if self.watcher is not None:
                self.watcher.complete(Path(message["run"]))

    def _lay(self, view: View, scene: Mapping[str, Any] | None) -> None:
        if self.watcher is not None:
            self.watcher.close()
        self.view = view
        self.watcher = Watcher(view, scene, self._wanted_u_s, self._law)
