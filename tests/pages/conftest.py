"""One browser and one old run's page for all tests of pages; a recording with its page for tests that act on it."""

import contextlib
import functools
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from springmass.cli import main
from tests.browser import chromium, headless
from tests.courses import damped, write_recording
from tests.pages.bench import LIMIT_S, MOVES, OLD_RUN, SEEN, Program, opened

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
KINDS = ("clipped", "undamped", "sixty_hz")
expect.set_options(timeout=LIMIT_S * 1e3)
LAPTOP: Any = {"width": 1366, "height": 900}


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Headless Chromium, offline. Where it is not installed the pages are not looked at; in CI that is a failure."""
    try:
        chromium()
    except FileNotFoundError as absent:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(str(absent))
    with headless() as launched:
        yield launched


@contextlib.contextmanager
def started(out: Path, *arguments: str) -> Iterator[Program]:
    """Start the program, wait for the address of its page, and kill it at the end if it still runs."""
    process = subprocess.Popen(
        [sys.executable, "-m", "springmass", *arguments, "--no-browser"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1", "XDG_STATE_HOME": str(out.parent / "state")},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
    )
    stream = process.stderr
    assert stream is not None
    messages: list[str] = []
    address_known = threading.Event()

    def read() -> None:
        for line in stream:
            messages.append(line)
            if "page: http" in line:
                address_known.set()
        address_known.set()

    reader = threading.Thread(target=read)
    reader.start()
    try:
        assert address_known.wait(LIMIT_S)
        found = re.search(r"page: (http\S+)", "".join(messages))
        assert found, "".join(messages)
        yield Program(process, found[1], messages, out, reader)
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        reader.join(LIMIT_S)
        stream.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Return a function that starts the program and waits for the address of its page; none outlives the test."""
    with ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(started(tmp_path / "run.h5", *arguments))


@pytest.fixture
def record(start: Callable[..., Program], tmp_path: Path) -> Callable[..., Program]:
    """Return a function that records a simulated bench with its page."""

    def recording(*arguments: str) -> Program:
        scene = tmp_path / "bench.toml"
        scene.write_text(SCENE)
        return start(
            "record", "--simulate", "--scene", str(scene), "-o", str(tmp_path / "run.h5"), "--page", *arguments
        )

    return recording


@contextlib.contextmanager
def watched(browser: Browser, **options: Any) -> Iterator[BrowserContext]:
    """Open a browser with separate cookies, in which an error on a page fails the test."""
    context = browser.new_context(viewport=LAPTOP, **options)
    context.set_default_timeout(LIMIT_S * 1e3)
    wrong: list[Any] = []
    context.on("weberror", lambda error: wrong.append(error.error))
    yield context
    context.close()
    assert not wrong


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """Return a browser with separate cookies."""
    with watched(browser) as found:
        yield found


@pytest.fixture(scope="package")
def old_run(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Any]]:
    """The address of the page of an old run, and the cookies of the browser that opened it."""
    with started(tmp_path_factory.mktemp("old"), "page", "--play", str(OLD_RUN)) as program:
        with watched(browser) as first:
            opened(first, program.address, MOVES)
            cookies = first.storage_state()
        yield program.address.partition("?")[0], cookies


@pytest.fixture
def replay(browser: Browser, old_run: tuple[str, Any]) -> Iterator[Page]:
    """Return the page of an old run, as it is when it has been opened."""
    address, cookies = old_run
    with watched(browser, storage_state=cookies) as context:
        page = opened(context, address, SEEN.format(count=11000))
        page.wait_for_function(MOVES)
        yield page


@pytest.fixture(scope="session")
def page_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that makes a page of each kind once: three reports, a simulation and a course."""
    out, data = tmp_path_factory.mktemp("pages"), OLD_RUN.parent
    clipped, undamped, slow = (str(data / f"{name}_simulated_position.txt") for name in KINDS)
    scenes = ["--scene", str(data / "undamped.scene.toml")]

    @functools.cache
    def made(name: str) -> Path:
        if name == "analyse":
            bench = ["--scene", str(data / "damped.scene.toml"), "--method", "classic"]
            assert main(["analyse", str(OLD_RUN), *bench, "--output", str(out)]) == 0
            return out / f"{OLD_RUN.name}.results" / "report.html"
        if name == "warned":
            assert main(["analyse", clipped, "--output", str(out)]) == 0
            return out / "clipped_simulated_position.txt.results" / "report.html"
        if name == "simulate":
            words = ["--scene", str(data / "damped.scene.toml"), "--against", str(OLD_RUN), "--seconds", "20"]
            assert main(["simulate", *words, "-o", str(out)]) == 0
            return out / "damped.simulated" / "simulation.html"
        if name == "compare":
            assert main(["compare", undamped, slow, *scenes, "--output", str(out / "compared")]) == 0
            return out / "compared" / "report.html"
        return course_of(out)

    return made


def course_of(top: Path) -> Path:
    """Return the page of a course of three runs, one at rest and one that cannot be read."""
    runs = top / "runs"
    runs.mkdir()
    for i in range(3):
        write_recording(runs / f"run{i}.txt", damped(i, omega=8.0 + 0.1 * i))
    write_recording(runs / "still.txt", 0.2 + 3e-4 * np.random.default_rng(1).standard_normal(800))
    (runs / "bad.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 600)
    (top / "runs.csv").write_text("path,section,bob_mass_kg\nruns/run0.txt,mon,0.2\nruns/run1.txt,tue,0.21\n")
    options = ["--runs", str(top / "runs.csv"), "--jobs", "1", "--reports", "1", "--accuracy", "fast"]
    assert main(["batch", str(runs), "-o", str(top / "course"), *options]) == 1
    return top / "course" / "index.html"


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page without network, its errors kept as failures."""
    with watched(browser, offline=True) as context:
        made = context.new_page()
        failed: list[str] = []
        made.on("requestfailed", lambda request: failed.append(request.url))
        yield made
        assert failed == []


WIDTHS = {"phone": (390, 844), "laptop": (1366, 768), "A4": (680, 970)}
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
    if (e.closest('[tabindex="0"]') && matchMedia('screen').matches) continue;  // a wide table that can be scrolled
    if (box.left < -0.5 || box.right > wide + 0.5) found.push('outside ' + name(e));
    if (style.overflowX !== 'visible' && e.scrollWidth > e.clientWidth + 1) found.push('cut off ' + name(e));
  }
  for (const picture of document.images)
    if (!picture.complete || picture.naturalWidth === 0) found.push('not shown ' + name(picture));
  return found;
}"""


@pytest.fixture
def show(page: Page) -> Callable[[Path, str], None]:
    """Return a function that opens a page as wide as a medium is; paper with the styles of print."""

    def shown(path: Path, width: str) -> None:
        wide, tall = WIDTHS[width]
        page.set_viewport_size({"width": wide, "height": tall})
        page.emulate_media(media="print" if width == "A4" else "screen")
        page.goto(path.as_uri())

    return shown
