"""A notebook widget that draws a recording while it goes on, with the page's chart and the page's messages."""

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
    """Return the widget's JavaScript module: uPlot, the charts, the page's store of samples, and the widget."""
    names = ("uPlot.iife.min.js", "charts.js", "samples.js", "notebook.js")
    return "\n".join((STATIC / name).read_text(encoding="utf-8") for name in names)


def live(source: str | os.PathLike[str], *, seconds: float | None = 10.0, **options: Any) -> anywidget.AnyWidget:
    """Return a notebook chart of a recording, which is updated until the recording ends.

    Parameters
    ----------
    source : path
        The wire log of a recording, or any recording that :func:`springmass.load` reads.
    seconds : float or None
        Duration that is shown, counted back from the latest sample, s; None shows everything. A finished recording is
        always shown whole.
    **options
        Options for a finished recording, as :func:`springmass.load` takes them.

    Raises
    ------
    ProgramError
        If anywidget is not installed.
    acquisition.errors.NeedsAnswer
        If the file lacks information that was not given.
    springmass.errors.ProgramError, storage.errors.StorageError
        If the source cannot be read.

    Notes
    -----
    The log is only read, so a notebook cannot delay or end a recording. Samples are sent as the page's binary messages
    (``docs/reference/page-messages.md``). ``chart.stop()`` stops the reading.
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
    """Sends all samples of one recording to one chart: first the earlier ones, then new ones as they arrive.

    Parameters
    ----------
    view : View
    poll : callable
        Adds newly arrived samples to the view.
    """

    def __init__(self, view: View, poll: Callable[[], None]) -> None:
        self._view, self._poll = view, poll
        self._lock, self._over = threading.Lock(), threading.Event()
        self._sent = 0

    def start(self, chart: Chart) -> None:
        """Start a thread that sends new samples until the recording has ended."""
        threading.Thread(target=self._go_on, args=(chart,), name="springmass-live", daemon=True).start()

    def begin(self, chart: Chart) -> None:
        """Send all samples from the beginning to a chart that requests them."""
        with self._lock:
            self._sent = 0
            chart.send(self._view.hello(controls=False))
            self._send(chart)

    def stop(self) -> None:
        """Stop reading the recording."""
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
                if self._sent:  # zero until the chart has requested the samples
                    self._send(chart)


class Chart(Protocol):
    """The receiver of the samples."""

    def send(self, content: Any, buffers: list[bytes] | None = None) -> None:
        """Send a message to the browser."""
        ...


def _opened(path: Path, options: Mapping[str, Any]) -> tuple[View, Callable[[], None]]:
    if kind_of(path) == "wire":
        feed = LogFeed(path)
        feed.poll()
        return feed.view, feed.poll
    return view_of(load_file(path, "springmass.live", options)), lambda: None
