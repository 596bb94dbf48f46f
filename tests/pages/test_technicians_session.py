"""A technician's session: zero, trigger, marks, reload, report, and the same run again."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import BrowserContext, Page

from storage.run_file.reading import open_run
from tests.pages.bench import FITTED, PHASE, SEEN, answer, opened, press

WIDTHS = {1366: 768, 768: 1024, 390: 844}
WHOLE = "() => motion && motion.accuracy === 'standard' && motion.estimates"
# While the recorder measures the rest position, the key does nothing and a request is visibly refused. One call tests
# both, because the measurement takes only three seconds.
NOT_WHILE_BUSY = """() => {
  if (bench().phase !== 'still') return false;
  document.dispatchEvent(new KeyboardEvent('keydown', { key: 't', bubbles: true }));
  request('arm', { type: 'arm', threshold_m: 0.01, keep_s: 1 });
  return !document.querySelector('#ask[open]') && document.getElementById('told').textContent.includes('Not done');
}"""
NUMBERS = "Object.fromEntries(Object.entries(motion.estimates).map(([name, e]) => [name, [e.value, e.u]]))"


def look_at(page: Page, step: str) -> None:
    """Check a step at every width, light and dark: accessibility, nothing beside the screen, nothing under the bar."""
    before = page.viewport_size
    for width, height in WIDTHS.items():
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            found = Axe().run(page)
            assert found.violations_count == 0, f"{step} at {width}, {scheme}: {found.generate_report()}"
            for whole in ("document.documentElement", "document.getElementById('content')"):
                assert page.evaluate(f"{whole}.scrollWidth <= {whole}.clientWidth"), (step, width, whole)
            ends, begins = page.evaluate(
                "[document.getElementById('content'), document.getElementById('actions')]"
                ".map((e, i) => i ? e.getBoundingClientRect().top : e.getBoundingClientRect().bottom)"
            )
            assert ends <= begins + 0.5
    page.emulate_media(color_scheme="light")
    assert before is not None
    page.set_viewport_size(before)


@pytest.mark.trials
def test_a_session_from_the_first_minute_to_the_report(
    record: Callable[..., Any], start: Callable[..., Any], context: BrowserContext
) -> None:
    """Each number is the same on the page, in the report and on the page of the saved run."""
    program = record("--ready", "--lan")
    page = opened(context, program.address, PHASE.format(phase="ready"))
    page.set_viewport_size({"width": 1366, "height": 768})
    page.wait_for_function("() => rate_hz() !== null")
    assert page.evaluate("rate_hz()") == pytest.approx(100.0, abs=5.0)
    look_at(page, "1-ready")
    press(page, "z")
    page.wait_for_function(NOT_WHILE_BUSY)
    page.wait_for_function(PHASE.format(phase="ready"))

    press(page, "t")
    answer(page, "1 cm", "1.5")
    page.wait_for_function(PHASE.format(phase="recording"))
    page.wait_for_function(FITTED)
    assert page.evaluate("motion.accuracy") == "fast"
    assert "Fast accuracy" in page.inner_text("#tier")
    assert abs(page.evaluate("motion.estimates.period.value") - 0.7573) < 0.005
    assert page.locator("#findings .error").count() == 0
    press(page, "m")
    answer(page, "lamp on")
    page.wait_for_function("() => state.marks.length === 1")
    page.wait_for_function(SEEN.format(count=900))

    look_at(page, "2-recording")

    page.reload()
    page.wait_for_function(FITTED)
    assert page.evaluate("rate_hz()") == pytest.approx(100.0, abs=5.0)
    assert "lamp on" in page.inner_text("#marks")
    assert page.evaluate("position.panel.label") == "displacement / mm"

    press(page, "s")
    answer(page)
    page.wait_for_function(PHASE.format(phase="built"))
    page.wait_for_function(WHOLE)
    assert "Standard accuracy, whole run" in page.inner_text("#tier")
    assert page.inner_text("#stopping") == ""
    assert page.evaluate("position.panel.label") == "displacement / mm"
    look_at(page, "3-saved")
    shown, marks = page.evaluate(NUMBERS), page.evaluate("state.marks")
    press(page, "o")
    page.wait_for_url("**/v2/report")
    page.go_back()
    press(page, "q")
    answer(page)
    assert program.ended() == 0

    reported = json.loads((program.out.parent / "run.results" / "results.json").read_text())
    stated = {name: [x["value"], x["u"]] for name, x in reported["estimates"].items() if name in shown}
    assert {"period", "damping_rate", "noise", "offset", "spring_constant", "quality_factor"} <= stated.keys()
    assert {name: shown[name] for name in stated} == stated
    with open_run(program.out) as run:
        assert marks == [[mark["t_s"], mark["text"]] for mark in run.provenance["marks"]]
        assert {"threshold_m": 0.01, "keep_s": 1.5} in [event["facts"] for event in run.provenance["events"]]

    again = start("page", "--play", str(program.out))
    page = opened(context, again.address, WHOLE)
    assert page.evaluate(NUMBERS) == shown
    assert page.evaluate("state.marks") == marks
    assert page.evaluate("position.panel.label") == "displacement / mm"
    page.locator("#time").fill("0.6")
    look_at(page, "4-replay")
    again.end()
