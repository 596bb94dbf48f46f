"""A report in a browser: what a student sees first, what a chart tells, what stays on paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page

from springmass.report.script import script_sha256

SCREEN = {"width": 1366, "height": 768}
BOTTOM = "(id) => document.querySelector(id).getBoundingClientRect().bottom"
SHOWN = "(id) => { const box = document.querySelector(id).getBoundingClientRect(); return box.width * box.height > 0; }"


@pytest.mark.parametrize("name", ["analyse", "warned", "compare"])
def test_the_first_screen_has_table_and_main_figure(
    page: Page, show: Callable[..., None], pages: dict[str, Path], name: str
) -> None:
    """On a laptop Table 1 is whole and the main chart stands beside it; unopened, a page is short."""
    page.set_viewport_size(SCREEN)
    page.goto(pages[name].as_uri())
    assert page.evaluate(BOTTOM, "table.results") <= SCREEN["height"]
    assert page.evaluate(BOTTOM, ".first .chart") <= SCREEN["height"]
    assert page.evaluate("document.documentElement.scrollHeight") <= 6000


def test_a_chart_zooms_moves_and_tells_a_value(page: Page, show: Callable[..., None], pages: dict[str, Path]) -> None:
    """Buttons change the range; the cursor tells the value, and of a flagged sample why it was left out."""
    show(pages["analyse"], "laptop")
    page.evaluate("document.querySelector('#position-0').closest('details').open = true")
    figure = page.locator("#figure-position-0")
    figure.locator(".u-over").first.wait_for()
    ticks = "() => [...document.querySelectorAll('#figure-position-0 canvas')].map(c => c.toDataURL())"
    before = page.evaluate(ticks)
    figure.get_by_role("button", name="zoom in").click()
    page.wait_for_timeout(100)
    zoomed = page.evaluate(ticks)
    figure.get_by_role("button", name="move right").click()
    page.wait_for_timeout(100)
    assert len({before[0], zoomed[0], page.evaluate(ticks)[0]}) == 3
    over = figure.locator(".u-over").first
    box = over.bounding_box()
    assert box is not None
    shown = []
    for share in range(5, 96, 2):
        over.hover(position={"x": box["width"] * share / 100, "y": box["height"] / 2})
        shown.append(figure.locator("output").inner_text())
    assert all(text.startswith("t = ") for text in shown)
    assert any("residual" in text for text in shown)


def test_a_link_of_a_warning_opens_its_figure(page: Page, show: Callable[..., None], pages: dict[str, Path]) -> None:
    """The folded part that holds the figure is opened."""
    show(pages["warned"], "laptop")
    page.locator(".findings li.warning a").first.click()
    page.wait_for_function("() => location.hash && document.querySelector(location.hash).closest('details').open")
    assert page.evaluate(SHOWN, page.evaluate("location.hash"))


def test_table_1_is_copied(page: Page, show: Callable[..., None], pages: dict[str, Path]) -> None:
    """As text, LaTeX and cells."""
    show(pages["analyse"], "laptop")
    page.evaluate("window.setTimeout = () => 0")  # the answer stays on the buttons
    for words in ("Copy as text", "Copy as LaTeX", "Copy as cells"):
        page.get_by_role("button", name=words).click()
    page.get_by_role("button", name="Copied").nth(2).wait_for()


def test_paper_shows_the_figures_and_no_buttons(page: Page, show: Callable[..., None], pages: dict[str, Path]) -> None:
    """In print the drawn figure takes the chart's place."""
    show(pages["analyse"], "laptop")
    assert page.evaluate(SHOWN, ".first .charts")
    assert not page.evaluate(SHOWN, ".first .card")
    page.emulate_media(media="print")
    assert not page.evaluate(SHOWN, ".first .charts")
    assert page.evaluate(SHOWN, ".first .card")
    assert not page.evaluate(SHOWN, "#copies")


def test_the_script_runs_under_the_policy_of_a_served_report(
    page: Page, pages: dict[str, Path], tmp_path: Path
) -> None:
    """Its digest lets it run; another inline script does not."""
    policy = f"default-src 'none'; script-src 'sha256-{script_sha256()}'; style-src 'unsafe-inline'; img-src data:"
    text = pages["analyse"].read_text("utf-8")
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    other = "<script>document.title = 'changed'</script></body>"
    served = tmp_path / "served.html"
    served.write_text(text.replace("<head>", f"<head>{meta}", 1).replace("</body>", other), "utf-8")
    page.goto(served.as_uri())
    assert page.evaluate(SHOWN, ".first .chart canvas")
    assert page.title() != "changed"
