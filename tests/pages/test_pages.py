"""Reports and the page of a course as readers meet them: on a laptop, a phone and paper, and by a screen reader."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from springmass.charts.browser import script_sha256
from tests.pages.conftest import OUTSIDE, WIDTHS
from tests.sampling import sampled

NAMES = ("analyse", "course", "warned", "compare", "simulate")
BOTTOM = "(id) => document.querySelector(id).getBoundingClientRect().bottom"
SHOWN = "(id) => { const box = document.querySelector(id).getBoundingClientRect(); return box.width * box.height > 0; }"
Show = Callable[[Path, str], None]
PageOf = Callable[[str], Path]


@pytest.mark.parametrize(("name", "width"), sampled(itertools.product(NAMES, WIDTHS)))
def test_nothing_is_clipped(page: Page, show: Show, page_of: PageOf, name: str, width: str) -> None:
    """Nothing lies outside the medium or is cut off, and every picture is shown."""
    show(page_of(name), width)
    assert page.evaluate(OUTSIDE) == []


@pytest.mark.parametrize(("name", "scheme"), sampled(itertools.product(NAMES, ("light", "dark")), 1))
def test_axe_finds_no_violation(page: Page, show: Show, page_of: PageOf, name: str, scheme: str) -> None:
    """By axe-core the page with all of its parts open is accessible, by day and by night."""
    show(page_of(name), "laptop")
    page.emulate_media(media="screen", color_scheme="dark" if scheme == "dark" else "light")
    page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
    found = Axe().run(page).response["violations"]
    assert found == [], json.dumps([(x["id"], x["help"], [n["html"][:160] for n in x["nodes"][:3]]) for x in found])


def test_paper_shows_every_chart_with_four_times_the_pixels(
    page: Page, show: Show, page_of: PageOf, tmp_path: Path
) -> None:
    """In print a canvas of light colours takes the chart's place; on A4 a report has fewer than twenty sheets."""
    show(page_of("analyse"), "A4")
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.wait_for_function("document.querySelectorAll('.paper').length === document.querySelectorAll('figure').length")
    wide = page.evaluate("[...document.querySelectorAll('.paper')].map((each) => each.width / each.clientWidth)")
    assert min(wide) > 3.5
    corner = "(each) => [...each.getContext('2d').getImageData(0, 0, 1, 1).data]"
    assert page.eval_on_selector(".paper", corner) == [255, 255, 255, 255]
    assert not page.evaluate(SHOWN, ".first .chart")
    assert not page.evaluate(SHOWN, ".copy button")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    margins = dict.fromkeys(("top", "left", "right", "bottom"), "15mm")
    printed = page.pdf(path=tmp_path / "page.pdf", format="A4", margin=margins)
    assert printed.startswith(b"%PDF")
    assert 3 < printed.count(b"/Type /Page\n") < 20


@pytest.mark.parametrize("name", sampled(["analyse", "warned", "compare"]))
def test_the_first_screen_has_table_and_main_figure(page: Page, show: Show, page_of: PageOf, name: str) -> None:
    """On a laptop Table 1 is whole and the main chart stands beside it."""
    show(page_of(name), "laptop")
    assert page.evaluate(BOTTOM, "table.results") <= WIDTHS["laptop"][1]
    assert page.evaluate(BOTTOM, ".first .chart .panel") <= WIDTHS["laptop"][1]


def test_a_chart_zooms_moves_and_shows_a_value(page: Page, show: Show, page_of: PageOf) -> None:
    """Buttons and the mouse change the range; the cursor shows the values, and why a sample was left out."""
    show(page_of("analyse"), "laptop")
    figure = page.locator("#figure-position-0")
    over = figure.locator(".u-over").first
    over.wait_for()
    drawn = "document.querySelector('#figure-position-0 canvas.paper, #figure-position-0 .u-wrap canvas').toDataURL()"
    for button in ("zoom in", "move right", "Lines", "samples used"):
        page.evaluate(f"window.before = {drawn}")
        figure.get_by_role("button", name=button).click()
        page.wait_for_function(f"() => {drawn} !== window.before")
    figure.get_by_role("button", name="samples used").click()
    box = over.bounding_box()
    assert box is not None
    shown = []
    for share in range(5, 100, 6):
        over.hover(position={"x": box["width"] * share / 100, "y": box["height"] / 2})
        shown.append(figure.locator("output").inner_text())
    assert all(text.startswith("time ") for text in shown)
    assert any("samples used 2" in text and " mm; fit 2" in text for text in shown)
    assert any("left out: false echo" in text for text in shown)
    page.evaluate(f"window.before = {drawn}")
    page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 90, box["y"] + 20, steps=4)
    page.mouse.up()
    page.wait_for_function(f"() => {drawn} !== window.before")


def test_without_scripts_the_page_says_so(browser: Browser, page_of: PageOf) -> None:
    """It names the option with which a report has pictures."""
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(page_of("analyse").as_uri())
    assert page.get_by_text("--figures svg").is_visible()
    context.close()


def test_a_link_of_a_warning_opens_its_figure(page: Page, show: Show, page_of: PageOf) -> None:
    """Its chart is shown, and a folded part that holds it is opened."""
    show(page_of("warned"), "laptop")
    page.locator(".findings li.warning a").first.click()
    page.wait_for_function("() => location.hash && document.querySelector(`${location.hash} canvas`)")
    assert page.evaluate(SHOWN, page.evaluate("`${location.hash} canvas`"))
    page.evaluate("location.hash = '#figure-phase-0'")
    page.wait_for_function("() => document.querySelector('#figure-phase-0 canvas')")
    assert page.evaluate(SHOWN, "#figure-phase-0 canvas")


def test_the_script_runs_under_the_policy_of_a_served_report(page: Page, page_of: PageOf, tmp_path: Path) -> None:
    """Its digest lets it run; another inline script does not."""
    policy = f"default-src 'none'; script-src 'sha256-{script_sha256()}'; style-src 'unsafe-inline'; img-src data:"
    text = page_of("analyse").read_text("utf-8")
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    other = "<script>document.title = 'changed'</script></body>"
    served = tmp_path / "served.html"
    served.write_text(text.replace("<head>", f"<head>{meta}", 1).replace("</body>", other), "utf-8")
    page.goto(served.as_uri())
    assert page.evaluate(SHOWN, ".first .panel canvas")
    assert page.title() != "changed"


def test_runs_of_a_course_sort_and_are_filtered(page: Page, page_of: PageOf) -> None:
    """Those that need a look first; by the period up and down, what has none last; only those that contain a word."""
    page.goto(page_of("course").as_uri())
    names = page.locator("#runs tbody th")
    assert names.all_text_contents()[:2] == ["bad", "still"]
    page.get_by_role("button", name="T / s", exact=True).click()
    assert names.all_text_contents()[:3] == ["run2", "run1", "run0"]
    page.get_by_role("button", name="T / s", exact=True).click()
    assert names.all_text_contents()[:3] == ["run0", "run1", "run2"]
    page.get_by_label("Show runs that contain").fill("TUE")
    assert page.locator("#runs tbody tr:visible th").all_text_contents() == ["run1"]
    page.get_by_label("Show runs that contain").fill("")
    # A click on a point of the chart finds its row; the first of two groups stands at a quarter.
    over = page.locator("figure.course .u-over")
    wide, high = over.evaluate("box => [box.clientWidth, box.clientHeight]")
    for y in range(2, high, 8):
        over.click(position={"x": wide / 4, "y": y})
    assert page.locator("#runs .picked th").all_text_contents() == ["run0"]
    page.locator("#runs a").click()
    page.wait_for_url("**/report.html")
