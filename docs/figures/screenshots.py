"""Take the pictures of the window, of the page and of a report, in headless Chromium: `make docs-figures`."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Page

from springmass import sample_data
from tests.browser import headless

HERE = Path(__file__).resolve().parent
RECORDED_MS = 25_000
"""Of the recording that the page shows; by then a damping law is drawn."""
SCENE = """
[bob]
mass_kg = { value = 0.2176, u = 0.00005 }
[spring]
constant_n_per_m = 14.0
mass_kg = { value = 0.010, u = 0.0005 }
[air]
temperature_c = 20.0
[damping]
gamma_per_s = 0.0073
beta_per_m_s = 0.235
[start]
displacement_m = 0.05
"""


def springmass(*arguments: str | Path) -> list[str]:
    """Return the command line that runs the program."""
    return [sys.executable, "-m", "springmass", *map(str, arguments)]


@contextmanager
def live(folder: Path) -> Iterator[str]:
    """Record a simulated bench with its page, and give the page's address."""
    (folder / "bench.toml").write_text(SCENE)
    command = springmass("record", "--simulate", "--scene", "bench.toml", "-o", "run.h5", "--page", "--no-browser")
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        try:
            addresses = (re.search(r"page: (http\S+)", line) for line in process.stderr)
            yield next(found[1] for found in addresses if found)
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate()


def take_page(page: Page, folder: Path) -> None:
    """Take the page of a recording that runs."""
    with live(folder) as address:
        page.set_viewport_size({"width": 1280, "height": 900})
        page.goto(address)
        page.wait_for_timeout(RECORDED_MS)
        page.screenshot(path=HERE / "page.png")
        page.goto("about:blank")


def take_window(page: Page, folder: Path) -> None:
    """Take the window with a bundled recording on its card."""
    command = springmass("page", "--no-browser")
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "XDG_STATE_HOME": str(folder)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            addresses = (re.search(r"page: (http\S+)", line) for line in process.stderr)
            page.set_viewport_size({"width": 1280, "height": 900})
            page.goto(next(found[1] for found in addresses if found))
            files = [sample_data() / f"damped_simulated_{each}.txt" for each in ("position", "velocity")]
            page.locator("#files").set_input_files(files)
            for of, value, u in (("mass of the bob", "217.6", "0.05"), ("mass of the spring", "10", "0.5")):
                page.get_by_label(of.capitalize(), exact=True).fill(value)
                page.get_by_label(f"u of the {of}", exact=True).fill(u)
            page.get_by_text("13.974").first.wait_for()
            page.wait_for_timeout(1000)
            page.screenshot(path=HERE / "window.png")
            page.goto("about:blank")
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate()


def take_report(page: Page, folder: Path) -> None:
    """Take the head of the report of a bundled run."""
    data = sample_data()
    run, scene = data / "damped_simulated_position.txt", data / "damped.scene.toml"
    command = springmass("-q", "analyse", run, "--scene", scene, "-o", folder)
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto((folder / "damped_simulated_position.txt.results" / "report.html").as_uri())
    page.screenshot(path=HERE / "report.png")


def main() -> None:
    """Take all."""
    with headless() as browser, TemporaryDirectory() as folder:
        page = browser.new_page()
        take_report(page, Path(folder))
        take_page(page, Path(folder))
        take_window(page, Path(folder))


if __name__ == "__main__":
    main()
