"""The browser that pages are looked at with: the system's Chromium, never one that was fetched from elsewhere."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser

OPTIONS = (
    "--no-sandbox --disable-gpu --disable-background-networking --disable-component-update --disable-sync "
    "--no-first-run --disable-dev-shm-usage"
)


def chromium() -> str:
    """Return the path of Chromium; FileNotFoundError if it is not installed."""
    path = shutil.which("chromium")
    if path is None:
        raise FileNotFoundError("chromium is not on the PATH; Debian: apt-get install chromium")
    return path


@contextmanager
def headless() -> Iterator[Browser]:
    """Start Chromium without a window, and end it."""
    from playwright.sync_api import sync_playwright

    path = chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=OPTIONS.split())
        try:
            yield browser
        finally:
            browser.close()
