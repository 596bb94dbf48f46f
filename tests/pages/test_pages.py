"""Pages as readers meet them: on a laptop, on a phone, on paper, and through a screen reader."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

NAMES = ("analyse", "warned", "compare")
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
  for (const svg of document.querySelectorAll('svg')) {
    const frame = svg.getBoundingClientRect();
    for (const text of svg.querySelectorAll('text')) {
      const box = text.getBoundingClientRect();
      if (box.left < frame.left - 1 || box.right > frame.right + 1
          || box.top < frame.top - 1 || box.bottom > frame.bottom + 1)
        found.push('outside its figure ' + name(text));
    }
  }
  return found;
}"""

SEEN = """() => [...document.querySelectorAll('table.laws thead th')].map(
  th => [th.textContent, th.getBoundingClientRect().right <= document.documentElement.clientWidth])"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page without network, its errors kept as failures."""
    context = browser.new_context(offline=True)
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("requestfailed", lambda request: errors.append(request.url))
    yield opened
    context.close()
    assert errors == []


def show(page: Page, path: Path, width: str) -> None:
    """Open a page as wide as a medium is; paper with the styles of print."""
    wide, tall = WIDTHS[width]
    page.set_viewport_size({"width": wide, "height": tall})
    page.emulate_media(media="print" if width == "A4" else "screen")
    page.goto(path.as_uri())


@pytest.mark.trials
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_clipped(page: Page, pages: dict[str, Path], name: str, width: str) -> None:
    """Nothing lies outside the medium, is cut off, or leaves its figure."""
    show(page, pages[name], width)
    assert page.evaluate(OUTSIDE) == []


@pytest.mark.parametrize("width", WIDTHS)
def test_what_decides_between_laws_is_in_view(page: Page, pages: dict[str, Path], width: str) -> None:
    """Chi-square, its difference, degrees of freedom and the BIC's difference stand in view on every medium."""
    show(page, pages["analyse"], width)
    heads = dict(page.evaluate(SEEN))
    assert {"reduced χ²", "Δχ²", "dof", "ΔBIC"} <= set(heads)
    assert all(heads.values())


@pytest.mark.trials
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", NAMES)
def test_axe_finds_no_violation(page: Page, pages: dict[str, Path], name: str, scheme: str) -> None:
    """By axe-core the page is accessible, by day and by night."""
    show(page, pages[name], "laptop")
    page.emulate_media(media="screen", color_scheme="dark" if scheme == "dark" else "light")
    found = Axe().run(page).response["violations"]
    assert found == [], json.dumps([(x["id"], x["help"], [n["html"][:160] for n in x["nodes"][:3]]) for x in found])


@pytest.mark.parametrize("name", NAMES)
def test_a_page_opens_within_a_second(page: Page, pages: dict[str, Path], name: str) -> None:
    """The fastest of five openings takes less than a second, figures and all."""
    taken = []
    for _ in range(5):
        show(page, pages[name], "laptop")
        taken.append(page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd"))
    assert 0 < min(taken) < 1000.0


def test_a_page_prints(page: Page, pages: dict[str, Path], tmp_path: Path) -> None:
    """On A4 it makes a document of fewer than twenty sheets."""
    page.goto(pages["analyse"].as_uri())
    printed = page.pdf(
        path=tmp_path / "page.pdf", format="A4", margin=dict.fromkeys(("top", "left", "right", "bottom"), "15mm")
    )
    assert printed.startswith(b"%PDF")
    assert 3 < printed.count(b"/Type /Page\n") < 20
