"""A recording in a notebook, drawn while it goes on: the page's chart and the page's messages, in a widget."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from springmass.api.sources import load_file
from springmass.errors import USAGE, ProgramError
from springmass.page.feeds import LogFeed, view_of
from springmass.page.view import View
from springmass.runs.loading import kind_of

if TYPE_CHECKING:
    import anywidget

__all__ = ["Transmission", "live", "script"]

STATIC = Path(__file__).parent.parent / "page" / "static"
TURN_S = 0.05


def script() -> str:
    """Return the widget's module: uPlot and the page's store of samples, and the chart."""
    names = ("uPlot.iife.min.js", "samples.js", "notebook.js")
    return "\n".join((STATIC / name).read_text(encoding="utf-8") for name in names)


def live(source: str | os.PathLike[str], *, seconds: float | None = 10.0, **options: Any) -> anywidget.AnyWidget:
    """Return a chart of a recording for a notebook, which goes on as long as the recording does.

    Parameters
    ----------
    source : path
        The wire log of a recording, or any recording that :func:`springmass.load` reads.
    seconds : float or None
        How much of its end is shown, s; None: all of it. A recording that is over is shown whole.
    **options
        Of a recording that is over, as :func:`springmass.load` takes them.

    Raises
    ------
    ProgramError
        If anywidget is not installed.
    acquisition.errors.NeedsAnswer
        If the file leaves something open that was not given.
    springmass.errors.ProgramError, storage.errors.StorageError
        If the source cannot be read.

    Notes
    -----
    The log is read and nothing is written: a notebook cannot delay or end a recording. Samples travel as the page's
    binary messages do (``docs/reference/page-messages.md``). ``chart.stop()`` ends the reading.
    """
    try:
        from springmass.api.live_widget import LiveChart
    except ImportError as error:
        raise ProgramError(
            "springmass.live needs anywidget, which is not installed: pip install springmass[notebook]", USAGE
        ) from error
    view, poll = _opened(Path(source), options)
    shown = 0.0 if view.ended or seconds is None or not math.isfinite(seconds) else seconds
    return LiveChart(Transmission(view, poll), seconds=shown)


class Transmission:
    """Sends the samples of one recording to one chart, from its beginning and as they come.

    Parameters
    ----------
    view : View
    poll : callable
        Takes what has come into the view.
    """

    def __init__(self, view: View, poll: Callable[[], None]) -> None:
        self._view, self._poll = view, poll
        self._lock, self._over = threading.Lock(), threading.Event()
        self._sent = 0

    def start(self, chart: Chart) -> None:
        """Send in a thread until the recording has ended."""
        threading.Thread(target=self._go_on, args=(chart,), name="springmass-live", daemon=True).start()

    def begin(self, chart: Chart) -> None:
        """Send all from the beginning to a chart that asks for it."""
        with self._lock:
            self._sent = 0
            chart.send(self._view.hello(controls=False))
            self._send(chart)

    def stop(self) -> None:
        """Read no further."""
        self._over.set()

    def _send(self, chart: Chart) -> None:
        series = self._view.series[0]
        while self._sent < len(series):
            message = series.message(0, self._sent)
            self._sent += (len(message) - 16) // 16
            chart.send({"type": "samples"}, buffers=[message])

    def _go_on(self, chart: Chart) -> None:
        while not self._over.wait(TURN_S) and not (self._view.ended or self._view.error):
            with self._lock:
                self._poll()
                if self._sent:  # nobody asked to begin yet
                    self._send(chart)


class Chart(Protocol):
    """What samples are sent to."""

    def send(self, content: Any, buffers: list[bytes] | None = None) -> None:
        """Send a message to the browser."""
        ...


def _opened(path: Path, options: Mapping[str, Any]) -> tuple[View, Callable[[], None]]:
    if kind_of(path) == "wire":
        feed = LogFeed(path)
        feed.poll()
        return feed.view, feed.poll
    return view_of(load_file(path, "springmass.live", options)), lambda: None
