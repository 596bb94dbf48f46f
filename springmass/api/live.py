"""A recording in a notebook, drawn while it goes on: the page's chart and the page's messages, in a widget."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.errors import NeedsAnswer
from springmass.errors import USAGE, ProgramError
from springmass.page.feeds import LogFeed, view_of
from springmass.page.view import View
from springmass.runs.loading import kind_of, load
from springmass.runs.questions import for_python

if TYPE_CHECKING:
    import anywidget

__all__ = ["live", "script"]

STATIC = Path(__file__).parent.parent / "page" / "static"
TURN_S = 0.05


def script() -> str:
    """Return the widget's module: uPlot and the page's store of samples, and the chart."""
    names = ("uPlot.iife.min.js", "samples.js", "notebook.js")
    return "\n".join((STATIC / name).read_text(encoding="utf-8") for name in names)


def live(source: str | os.PathLike[str], *, seconds: float | None = 10.0, **completions: Any) -> anywidget.AnyWidget:
    """Return a chart of a recording for a notebook, which goes on as long as the recording does.

    Parameters
    ----------
    source : path
        The wire log of a recording, or any recording that :func:`springmass.load` reads.
    seconds : float or None
        How much of its end is shown, s; None: all of it. A recording that is over is shown whole.
    **completions
        What a recording that is over leaves open, as :func:`springmass.load` takes it.

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
        import anywidget
        import traitlets
    except ImportError as error:
        raise ProgramError(
            "springmass.live needs anywidget, which is not installed: pip install springmass[notebook]", USAGE
        ) from error
    path = Path(source)
    view, poll = _opened(path, completions)

    class Live(anywidget.AnyWidget):
        """The chart in the notebook."""

        _esm = script()
        _css = (STATIC / "uPlot.min.css").read_text(encoding="utf-8") or " "
        seconds = traitlets.Float(0.0).tag(sync=True)

        def stop(self) -> None:
            """Read no further."""
            over.set()

    over = threading.Event()
    shown = 0.0 if view.ended or seconds is None or not math.isfinite(seconds) else seconds
    widget = Live(seconds=shown)
    lock = threading.Lock()
    sent = 0

    def send() -> None:
        nonlocal sent
        series = view.series[0]
        while sent < len(series):
            message = series.message(0, sent)
            sent += (len(message) - 16) // 16
            widget.send({"type": "samples"}, buffers=[message])

    def asked(_: Any, content: Any, _buffers: Any) -> None:
        nonlocal sent
        if isinstance(content, dict) and content.get("type") == "begin":
            with lock:
                sent = 0
                widget.send(view.hello(controls=False))
                send()

    def go_on() -> None:
        while not over.wait(TURN_S) and not (view.ended or view.error):
            with lock:
                poll()
                if sent:
                    send()

    widget.on_msg(asked)
    threading.Thread(target=go_on, name="springmass-live", daemon=True).start()
    return widget


def _opened(path: Path, completions: Mapping[str, Any]) -> tuple[View, Callable[[], None]]:
    if kind_of(path) == "wire":
        feed = LogFeed(path)
        feed.poll()
        return feed.view, feed.poll
    try:
        return view_of(load(path, **completions)), lambda: None
    except NeedsAnswer as asked:
        raise asked.with_remedy(for_python(asked.question, "springmass.live", completions)) from None
