"""Pages in a browser: Debian's Chromium, driven by playwright, never a browser that was fetched from elsewhere."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

from springmass.cli import main
from springmass.runs.loading import sample_data

QUIET = (
    "--no-sandbox --disable-gpu --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run --disable-dev-shm-usage"
)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium, offline."""
    chromium = shutil.which("chromium")
    assert chromium is not None, "no chromium on the PATH; apt-get install chromium, as .ci/run does"
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=chromium, args=QUIET.split())
        yield launched
        launched.close()


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
