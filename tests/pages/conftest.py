"""Pages in a browser, driven by playwright."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from springmass.cli import main
from springmass.runs.loading import sample_data
from tests.browser import chromium, headless

LIMIT_S = 180.0
SCENE = """
[bob]
mass_kg = { value = 0.2, u = 0.0001 }
[spring]
constant_n_per_m = 14.0
mass_kg = { value = 0.01, u = 0.0005 }
[air]
temperature_c = 20.0
[damping]
gamma_per_s = 0.01
[start]
displacement_m = 0.05
"""


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium, offline. Where it is not installed the pages are not looked at; in CI that is a failure."""
    try:
        chromium()
    except FileNotFoundError as absent:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(str(absent))
    with headless() as launched:
        yield launched


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The page of each command that writes one, of the bundled recordings."""
    out, data = tmp_path_factory.mktemp("pages"), sample_data()

    undamped, damped, clipped = (
        str(data / f"{name}_simulated_position.txt") for name in ("undamped", "damped", "clipped")
    )
    scenes = ["--scene", str(data / "undamped.scene.toml"), "--scene", str(data / "damped.scene.toml")]
    velocity = ["--velocity", str(data / "damped_simulated_velocity.txt")]
    assert main(["analyse", damped, *velocity, *scenes[2:], "--method", "classic", "--out", str(out)]) == 0
    assert main(["analyse", clipped, "--out", str(out)]) == 0
    assert main(["compare", undamped, damped, *scenes, "--out", str(out / "compared")]) == 0
    return {
        "analyse": out / "damped_simulated_position.results" / "report.html",
        "warned": out / "clipped_simulated_position.results" / "report.html",
        "compare": out / "compared" / "report.html",
    }


@dataclass
class Program:
    """A process of the program with a page."""

    process: subprocess.Popen[str]
    address: str
    messages: list[str]
    out: Path
    reader: threading.Thread

    def ended(self) -> int:
        """Wait for its end and its last message; return the exit code."""
        code = self.process.wait(LIMIT_S)
        self.reader.join(LIMIT_S)
        return code

    def end(self) -> None:
        """End it as Ctrl-C does."""
        self.process.send_signal(signal.SIGINT)
        self.ended()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Return a function that starts the program and waits for the address of its page; none outlives the test."""
    with ExitStack() as stack:

        def started(*arguments: str) -> Program:
            command = [sys.executable, "-m", "springmass", *arguments, "--no-browser"]
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
            )
            messages: list[str] = []
            address_known = threading.Event()

            def read() -> None:
                assert process.stderr is not None
                for line in process.stderr:
                    messages.append(line)
                    if "page: http" in line:
                        address_known.set()
                address_known.set()

            reader = threading.Thread(target=read)
            reader.start()

            def stop() -> None:
                if process.poll() is None:
                    process.kill()
                process.wait()
                reader.join(LIMIT_S)
                assert process.stderr is not None
                process.stderr.close()

            stack.callback(stop)
            assert address_known.wait(LIMIT_S)
            found = re.search(r"page: (http\S+)", "".join(messages))
            assert found, "".join(messages)
            return Program(process, found[1], messages, tmp_path / "run.h5", reader)

        yield started


@pytest.fixture
def record(start: Callable[..., Program], tmp_path: Path) -> Callable[..., Program]:
    """Return a function that records a simulated bench with its page."""

    def recording(*arguments: str) -> Program:
        scene = tmp_path / "bench.toml"
        scene.write_text(SCENE)
        return start("record", "--simulate", str(scene), "-o", str(tmp_path / "run.h5"), "--page", *arguments)

    return recording


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """Return a browser with separate cookies, in which an error on a page fails the test."""
    context = browser.new_context(viewport={"width": 1366, "height": 900})
    context.set_default_timeout(LIMIT_S * 1e3)
    wrong: list[Any] = []
    context.on("weberror", lambda error: wrong.append(error.error))
    yield context
    context.close()
    assert not wrong


WIDTHS = {"laptop": (1366, 768), "phone": (390, 844), "A4": (680, 970)}
"""Pixels; A4 less margins of 15 mm at 96 pixels an inch."""

OUTSIDE = """() => {
  const found = [], wide = document.documentElement.clientWidth;
  const name = e => `${e.tagName}.${e.getAttribute('class') || ''}: ${(e.textContent || '').trim().slice(0, 40)}`;
  if (document.documentElement.scrollWidth > wide) found.push('the page scrolls sideways');
  for (const e of document.querySelectorAll('body *')) {
    const style = getComputedStyle(e), box = e.getBoundingClientRect();
    const head = e.closest('thead');
    if (head && getComputedStyle(head).position === 'absolute') continue;  // for screen readers alone
    if (e.closest('svg') || box.width === 0) continue;
    if (box.left < -0.5 || box.right > wide + 0.5) found.push('outside ' + name(e));
    if (style.overflowX !== 'visible' && e.scrollWidth > e.clientWidth + 1) found.push('cut off ' + name(e));
  }
  for (const picture of document.images)
    if (!picture.complete || picture.naturalWidth === 0) found.push('not shown ' + name(picture));
  return found;
}"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page without network, its errors kept as failures."""
    context = browser.new_context(offline=True)
    context.set_default_timeout(LIMIT_S * 1e3)
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("requestfailed", lambda request: errors.append(request.url))
    yield opened
    context.close()
    assert errors == []


@pytest.fixture
def show(page: Page) -> Callable[[Path, str], None]:
    """Return a function that opens a page as wide as a medium is; paper with the styles of print."""

    def shown(path: Path, width: str) -> None:
        wide, tall = WIDTHS[width]
        page.set_viewport_size({"width": wide, "height": tall})
        page.emulate_media(media="print" if width == "A4" else "screen")
        page.goto(path.as_uri())

    return shown


@pytest.fixture
def clipped(page: Page, show: Callable[[Path, str], None]) -> Callable[[Path, str], list[str]]:
    """Return a function that names what of a page lies outside a medium, is cut off, or is not shown."""

    def outside(path: Path, width: str) -> list[str]:
        show(path, width)
        return list(page.evaluate(OUTSIDE))

    return outside
