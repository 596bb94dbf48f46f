"""The chart for a notebook; importing this module requires anywidget."""

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
        The sender of the samples.
    **traits
        ``seconds``: the duration that is shown, counted back from the latest sample, s; 0 shows everything.
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
        """Stop reading the recording."""
        self._transmission.stop()

    def _take(self, _: Any, content: Any, _buffers: Any) -> None:
        if isinstance(content, dict) and content.get("type") == "begin":
            self._transmission.begin(self)
