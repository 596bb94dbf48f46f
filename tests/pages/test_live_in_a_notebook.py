"""The chart of a recording in a notebook: what the kernel sends, and what a browser draws of it."""

from __future__ import annotations

import base64
import functools
import http.server
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from playwright.sync_api import BrowserContext

import springmass
from springmass.api.live import script
from springmass.errors import ProgramError

RUN = springmass.sample_data() / "damped_simulated_position.txt"

FRONT = """<!doctype html><title>widget</title><link rel="stylesheet" href="/widget.css">
<div id="out" style="width: 640px"></div><script type="module">
import widget from "/widget.js";
const listeners = [], asked = [];
const model = { get: () => 0, on: (name, call) => listeners.push(call), send: (content) => asked.push(content) };
widget.render({ model, el: document.getElementById("out") });
window.asked = asked;
window.deliver = (message, base64) => {
  const bytes = base64 ? [new DataView(Uint8Array.from(atob(base64), (c) => c.charCodeAt(0)).buffer)] : [];
  for (const call of listeners) call(message, bytes);
};
</script>"""


class Sent:
    """What a widget sends, without a kernel."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.messages: list[tuple[dict[str, Any], list[bytes]]] = []
        import anywidget

        monkeypatch.setattr(anywidget.AnyWidget, "send", self._take)

    def _take(self, content: dict[str, Any], buffers: list[bytes] | None = None) -> None:
        self.messages.append((content, buffers or []))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """Return the address of a page that shows the widget as a notebook's front end does."""
    (tmp_path / "index.html").write_text(FRONT)
    (tmp_path / "widget.js").write_text(script())
    (tmp_path / "widget.css").write_text(springmass.live(RUN)._css)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(tmp_path))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


def test_a_browser_draws_what_the_kernel_sends(
    monkeypatch: pytest.MonkeyPatch, served: str, context: BrowserContext
) -> None:
    """Every sample of the run arrives, also where all is sent again, and a curve is drawn."""
    sent = Sent(monkeypatch)
    widget = springmass.live(RUN)
    page = context.new_page()
    page.goto(served)
    page.wait_for_function("() => window.asked && window.asked.length")
    for _ in range(2):
        widget._handle_custom_msg(page.evaluate("asked[0]"), [])
    for content, buffers in sent.messages:
        page.evaluate("([m, b]) => deliver(m, b)", [content, base64.b64encode(buffers[0]).decode() if buffers else ""])
    assert "SIMULATED" in page.inner_text("#out")
    dark = """() => { const c = document.querySelector('#out canvas');
      const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 2] > 120 && d[i + 3] > 0 && d[i] < 80) n++;
      return n; }"""
    page.wait_for_function(f"() => ({dark})() > 500")
    drawn, below = page.locator("#out canvas").bounding_box(), page.get_by_text("SIMULATED").bounding_box()
    assert drawn is not None
    assert below is not None
    assert below["y"] >= drawn["y"] + drawn["height"]
    count = np.frombuffer(sent.messages[1][1][0], "<u4", 4)[3]
    assert count == len(springmass.load(RUN).samples)
    widget.stop()


def test_a_notebook_shows_it(tmp_path: Path) -> None:
    """A kernel executes the cell, and its output is a widget."""
    cell = nbformat.v4.new_code_cell(f"import springmass\nspringmass.live({str(RUN)!r})")
    notebook = nbformat.v4.new_notebook(cells=[cell])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    (output,) = [o for o in notebook.cells[0].outputs if o.output_type == "execute_result"]
    assert "application/vnd.jupyter.widget-view+json" in output.data


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra one line says what to install."""
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "springmass.api.live_widget", raising=False)
    with pytest.raises(ProgramError, match="pip install"):
        springmass.live(RUN)
