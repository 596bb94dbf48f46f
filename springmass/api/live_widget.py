"""The chart in a notebook; its import needs anywidget."""

from __future__ import annotations

from typing import Any

import anywidget
import traitlets

from springmass.api.live import STATIC, Transmission, script

__all__ = ["LiveChart"]


class LiveChart(anywidget.AnyWidget):
    """A chart of a recording.

    Parameters
    ----------
    transmission : Transmission
        What sends the samples.
    **traits
        ``seconds``: how much of the end is shown, s; 0: all of it.
    """

    _esm = script()
    _css = (STATIC / "uPlot.min.css").read_text(encoding="utf-8") or " "
    seconds = traitlets.Float(0.0).tag(sync=True)

    def __init__(self, transmission: Transmission, **traits: Any) -> None:
        super().__init__(**traits)
        self._transmission = transmission
        self.on_msg(self._take)
        transmission.start(self)

    def stop(self) -> None:
        """Read no further."""
        self._transmission.stop()

    def _take(self, _: Any, content: Any, _buffers: Any) -> None:
        if isinstance(content, dict) and content.get("type") == "begin":
            self._transmission.begin(self)
