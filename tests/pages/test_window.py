"""The window as a person meets it who does not type commands: by visible labels alone, with the mouse or the keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.pages.conftest import started, watched
from tests.pages.window import MASS_G, excel, pair, phyphox, tracker


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a window."""
    with started(tmp_path_factory.mktemp("window") / "x", "page") as program:
        yield program.address


@pytest.fixture
def window(browser: Browser, address: str) -> Iterator[Page]:
    """Return the page of a window."""
    with watched(browser) as context:
        page = context.new_page()
        page.goto(address)
        yield page
        for _ in range(page.get_by_role("button", name="Remove").count()):
            page.get_by_role("button", name="Remove").first.click()
        page.wait_for_selector("body.empty")


DROPPED: dict[str, tuple[dict[str, bytes], dict[str, str]]] = {
    "tracker": ({"pendulum.txt": tracker().encode()}, {"Column of values": "y", "Unit of y": "m"}),
    "excel": ({"Messung.xlsx": excel()}, {"Unit of Auslenkung": "cm"}),
    "pair": (pair(), {}),
    "phyphox": ({"Acceleration.zip": phyphox()}, {"Column of values": "Linear Acceleration y"}),
}


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("kind", DROPPED)
def test_from_a_file_to_k(window: Page, kind: str, width: int) -> None:
    """Files are chosen, questions answered, a mass typed, and k stands there with its u, in at most twelve actions."""
    files, answers = DROPPED[kind]
    window.set_viewport_size({"width": width, "height": 900})
    payload: Any = [{"name": name, "mimeType": "", "buffer": content} for name, content in files.items()]
    with window.expect_file_chooser() as chooser:
        window.get_by_role("button", name="Choose files").click()
    chooser.value.set_files(payload)
    for label, answer in answers.items():
        window.get_by_label(label, exact=True).select_option(answer)
    window.get_by_label("Mass of the bob", exact=True).fill(str(MASS_G))
    k = window.get_by_role("row", name="spring constant").locator("td").nth(1)
    k.get_by_text("±").wait_for()
    value, u = (float(part) for part in k.inner_text().removesuffix("N/m").split("±"))
    true = {"pair": 14.0}.get(kind, 64.0 * MASS_G * 1e-3)
    assert abs(value - true) < max(4.0 * u, 0.02 * true)
