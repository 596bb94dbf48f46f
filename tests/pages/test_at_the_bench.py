"""What is done at the bench on the page: every step is shown once the recorder has acknowledged it."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page
from websockets.sync.client import connect

from springmass.page.run_actions import ASIDE
from storage.run_file.reading import open_run

SEEN = "() => samples.length && samples[0].count > {count}"
PHASE = "() => bench().phase === '{phase}'"
# The page itself records what it shows only briefly, because a busy computer may look too late.
STAGES = """() => {
  const stage = document.getElementById('stage');
  window.stages = [];
  new MutationObserver(() => stages.push(stage.textContent)).observe(stage, { childList: true, characterData: true });
}"""
LOST_ONCE = """() => {
  const trouble = document.getElementById('trouble');
  window.lost_once = false;
  new MutationObserver(() => { if (!trouble.hidden) window.lost_once = true; }).observe(trouble, { attributes: true });
}"""


def answer(page: Page, *texts: str) -> None:
    """Answer the page's question."""
    page.wait_for_selector("#ask[open]")
    for field, text in zip(page.locator("#ask input").all(), texts, strict=True):
        field.fill(text)
    page.keyboard.press("Enter")


def press(page: Page, key: str) -> None:
    """Press a key once its button is there."""
    page.wait_for_selector(f"#actions button[data-key='{key}']:not([hidden])")
    page.keyboard.press(key)


@pytest.fixture
def bench(record: Callable[..., Any], context: BrowserContext) -> tuple[Any, Page]:
    """Return a bench that is ready, and its page."""
    program = record("--ready")
    page = context.new_page()
    page.goto(program.address)
    page.wait_for_function(PHASE.format(phase="ready"))
    return program, page


@pytest.mark.trials
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1366, 390])
def test_everybody_can_read_a_bench(
    record: Callable[..., Any], context: BrowserContext, width: int, scheme: Any
) -> None:
    """While it records: no violation of the accessibility rules, nothing wider than the screen."""
    program = record()
    page = context.new_page()
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 844})
    page.goto(program.address)
    page.wait_for_function(SEEN.format(count=600))
    page.wait_for_function("() => motion && motion.omega")
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if folder := os.environ.get("SPRINGMASS_SCREENSHOTS"):
        page.screenshot(path=Path(folder) / f"live-{width}-{scheme}.png", full_page=True)


def page_process(program: Any) -> int:
    """Return the number of the page's process."""
    command = f"springmass page --recorder.* {program.out.with_suffix('.wire')}"
    found = subprocess.run(["pgrep", "-f", command], capture_output=True, text=True)
    (pid,) = found.stdout.split()
    return int(pid)


def test_the_first_minute(bench: tuple[Any, Page]) -> None:
    """From opening to the report in five actions: zero, record, stop, yes, report."""
    program, page = bench
    page.wait_for_function(SEEN.format(count=100))
    press(page, "z")
    page.wait_for_function("() => bench().phase === 'ready' && bench().rest_m")
    assert "zero 250." in page.inner_text("#calibration")
    assert page.evaluate("position.labels[1]") == "displacement / mm"
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    page.wait_for_function("() => motion && motion.estimates && motion.estimates.period && motion.estimates.period.u")
    page.wait_for_function("() => phase.plot.data[0].length > 50 && spectrum.plot.data[0].length > 50")
    for chart in ("position", "amplitude", "phase", "spectrum"):
        assert page.locator(f"div#{chart} canvas").count() == 1
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(set(ids)) == len(ids)
    press(page, "s")
    answer(page)
    page.wait_for_function(PHASE.format(phase="built"))
    press(page, "o")
    page.wait_for_url("**/v1/report")
    assert "Period" in page.inner_text("body") or "period" in page.inner_text("body")
    page.go_back()
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    with open_run(program.out) as run:
        kinds = [event["kind"] for event in run.provenance["events"]]
    assert "still" in kinds
    assert (program.out.parent / "run.results" / "report.html").is_file()


@pytest.mark.trials
def test_the_trigger_keeps_what_came_before(bench: tuple[Any, Page]) -> None:
    """Zeroed and armed on the page, the run begins by itself, with the seconds from before its moment."""
    program, page = bench
    press(page, "z")
    page.wait_for_function("() => bench().phase === 'ready' && bench().rest_m")
    page.evaluate(STAGES)
    press(page, "t")
    answer(page, "10", "1.5")
    page.wait_for_function(PHASE.format(phase="recording"))
    assert "ARMED: 10 mm, 1.5 s kept" in page.evaluate("stages")
    page.wait_for_function(SEEN.format(count=300))
    program.end()
    with open_run(program.out) as run:
        samples = run.samples()
        (event,) = [event for event in run.provenance["events"] if event["kind"] == "trigger"]
    assert event["facts"] == {"threshold_m": 0.01, "keep_s": 1.5}
    moved = np.abs(samples.distance - np.median(samples.distance[:50])) > 0.01
    # By the stamps of the samples, which decide what is kept: a busy computer reads samples late, several at a time,
    # and gives them one stamp.
    stamps_s = (samples.host_ns - event["mono_ns"]) * 1e-9
    first = int(moved.argmax())
    assert np.abs(stamps_s[first - 1 : first + 2]).min() < 1e-6
    steps_s = np.diff(stamps_s[: moved.argmax()])
    assert -1.5 <= stamps_s[0] <= -1.5 + 0.03 + steps_s.max()


@pytest.mark.trials
def test_a_trigger_is_disarmed_and_the_run_begun_by_hand(bench: tuple[Any, Page]) -> None:
    """T again goes back to ready; what is asked beyond what may be is passed over."""
    program, page = bench
    press(page, "t")
    answer(page, "500", "2")
    page.wait_for_function(PHASE.format(phase="armed"))
    page.evaluate("ask_server({ type: 'stop' })")  # nothing is recorded: there is nothing to stop
    press(page, "t")
    page.wait_for_function(PHASE.format(phase="ready"))
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    program.end()


@pytest.mark.trials
def test_record_while_armed_begins_the_run(bench: tuple[Any, Page]) -> None:
    """Record, pressed once, ends the wait for the trigger and begins the recording."""
    program, page = bench
    press(page, "t")
    answer(page, "500", "2")
    page.wait_for_function(PHASE.format(phase="armed"))
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    program.end()


@pytest.mark.trials
def test_a_ruler_moves_the_zero_of_the_distances(bench: tuple[Any, Page]) -> None:
    """The bob that hangs at 250 mm is said to hang at 260: the run's distances say so too."""
    program, page = bench
    press(page, "k")
    answer(page, "260")
    page.wait_for_function("() => bench().phase === 'ready' && bench().ruler_m")
    page.wait_for_function("() => run.calibration.startsWith('by ruler: offset')")
    assert page.evaluate("bench().rest_m") == pytest.approx(0.26, abs=1e-3)
    press(page, "k")
    answer(page, "900")  # the bob hangs where it hung: two distances for one place
    page.wait_for_function("() => bench().failed")
    assert "move the target" in page.inner_text("#told")
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    page.wait_for_function(SEEN.format(count=50))
    program.end()
    with open_run(program.out) as run:
        assert run.provenance["sensor"]["calibration"]["offset_m"] == pytest.approx(0.01, abs=1e-3)


@pytest.mark.trials
def test_notes_and_putting_aside(bench: tuple[Any, Page]) -> None:
    """Notes stand in the log and beside the run; a discarded run is not deleted."""
    program, page = bench
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    page.wait_for_function(SEEN.format(count=50))
    press(page, "n")
    answer(page, "new spring")
    page.wait_for_function("() => state.notes.some((text) => text.includes('new spring'))")
    press(page, "s")
    answer(page)
    page.wait_for_function(PHASE.format(phase="built"))
    press(page, "n")
    answer(page, "table was pushed")
    page.wait_for_function("() => bench().noted.length === 1")
    press(page, "d")
    answer(page)
    page.wait_for_function("() => bench().discarded")
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    assert not program.out.exists()
    with open_run(program.out.parent / ASIDE / "run.h5") as run:
        assert {"text": "new spring"} in [event["facts"] for event in run.provenance["events"]]
    assert "table was pushed" in (program.out.parent / ASIDE / "run.about.toml").read_text()


def test_nothing_is_recorded_where_the_page_is_closed_before(bench: tuple[Any, Page]) -> None:
    """The program ends with 0 and leaves nothing."""
    program, page = bench
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    assert not program.out.exists()
    assert "nothing was recorded" in "".join(program.messages)


@pytest.mark.trials
def test_a_killed_server_comes_back(bench: tuple[Any, Page]) -> None:
    """Under the same address, to the same browser, which needs no other link; the recording lacks nothing."""
    program, page = bench
    press(page, "r")
    page.wait_for_function(PHASE.format(phase="recording"))
    page.wait_for_function(SEEN.format(count=100))
    session, killed = page.evaluate("run.session"), page_process(program)
    os.kill(killed, 9)
    page.wait_for_function("() => document.getElementById('trouble').textContent.includes('server is lost')")
    page.wait_for_function(f"() => run.session !== '{session}' && samples[0].count > 200")
    assert page.is_hidden("#trouble")
    assert page.evaluate("bench().phase") == "recording"
    press(page, "s")
    answer(page)
    page.wait_for_function(PHASE.format(phase="built"))
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    with open_run(program.out) as run:
        assert np.isfinite(run.samples().distance).all()


@pytest.fixture
def viewers(record: Callable[..., Any], context: BrowserContext) -> tuple[Any, Page, str]:
    """Return a recording that is open to viewers, its page, and their address."""
    program = record("--lan")
    page = context.new_page()
    page.goto(program.address)
    page.wait_for_function(PHASE.format(phase="recording"))
    return program, page, page.evaluate("run.share")


@pytest.mark.trials
def test_two_viewers_and_one_controller(viewers: tuple[Any, Page, str], browser: Browser) -> None:
    """Viewers see the samples and the state, and can change nothing; their address is shown, and as a QR code."""
    program, page, address = viewers
    assert f"viewers in this network: {address}" in "".join(program.messages)
    press(page, "l")
    assert page.inner_text("#address") == address
    page.wait_for_function("() => document.getElementById('code').naturalWidth > 100")
    page.keyboard.press("Escape")
    others = [browser.new_context(viewport={"width": 390, "height": 844}) for _ in range(2)]
    for other in others:
        looking = other.new_page()
        looking.goto(address)
        looking.wait_for_function(SEEN.format(count=100))
        assert looking.evaluate("run.role") == "viewer"
        assert looking.is_visible("#role")
        assert looking.is_hidden("#mark")
        assert looking.is_hidden("#stop")
        assert looking.evaluate("run.controls") is False
        looking.evaluate(LOST_ONCE)
        looking.evaluate("ask_server({ type: 'stop' })")  # refused: the connection is closed, and made anew
        looking.wait_for_function("() => lost_once && document.getElementById('trouble').hidden")
    press(page, "m")
    answer(page, "seen by all")
    page.wait_for_function("() => state.marks.length === 1")
    for other in others:
        other.pages[0].wait_for_function("() => state.marks.length === 1")
        other.close()
    assert page.evaluate("bench().phase") == "recording"
    program.end()


@pytest.mark.trials
def test_a_viewer_by_a_script(viewers: tuple[Any, Page, str]) -> None:
    """What no browser would send is refused too: a command closes the socket with 1003."""
    import http.client
    from urllib.parse import urlsplit

    program, _, address = viewers
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.netloc)
    connection.request("GET", f"/?{parts.query}")
    cookie = str(connection.getresponse().headers["Set-Cookie"]).split(";")[0]
    connection.close()
    with connect(
        f"ws://{parts.netloc}/v1/run",
        origin=f"http://{parts.netloc}",  # type: ignore[arg-type]
        additional_headers={"Cookie": cookie},
    ) as run:
        hello = json.loads(run.recv())
        assert (hello["role"], hello["controls"]) == ("viewer", False)
        run.send('{"type": "mark", "text": "no"}')
        while run.close_code is None:
            try:
                run.recv()
            except Exception:
                break
        assert run.close_code == 1003
    program.end()


@pytest.mark.trials
def test_the_cursor_and_a_part_by_the_keyboard(start: Callable[..., Any], context: BrowserContext) -> None:
    """X puts the cursor, arrows move it, Enter pins it, G has the part between fitted; arrows scrub without it."""
    import springmass

    program = start("replay", str(Path(springmass.sample_data()) / "damped_simulated_position.txt"), "--page")
    page = context.new_page()
    page.goto(program.address)
    page.wait_for_function(SEEN.format(count=11000))
    page.wait_for_function("() => motion && motion.estimates")
    page.keyboard.press("x")
    page.keyboard.press("Enter")
    for _ in range(20):
        page.keyboard.press("Shift+ArrowRight")
    assert "slope" in page.inner_text("#cursor")
    page.keyboard.press("g")
    cell = page.wait_for_selector("#region-estimates tr[data-name='period'] td")
    assert cell is not None
    assert float(cell.inner_text().split("(")[0]) == pytest.approx(0.7901, abs=0.001)
    page.keyboard.press("x")
    assert page.inner_text("#cursor") == ""
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("play_time") == pytest.approx(page.evaluate("samples[0].t[samples[0].count - 1]") - 1.0)
