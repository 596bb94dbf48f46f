"""The bench page as its user meets it, in a real browser, on real processes."""

from __future__ import annotations

import csv
import http.client
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import BrowserContext, Page
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

import springmass
from storage.run_file.reading import open_run
from tests.pages.conftest import LIMIT_S

SEEN = "() => samples.length && samples[0].count > {count}"
MOVES = "() => motion && motion.estimates && motion.estimates.period"


def answer(page: Page, *texts: str) -> None:
    """Answer the page's question."""
    page.wait_for_selector("#ask[open]")
    for field, text in zip(page.locator("#ask input").all(), texts, strict=True):
        field.fill(text)
    page.keyboard.press("Enter")


def act(page: Page, key: str, then: str) -> None:
    """Press a key once its button is there, and wait for what the recorder says of it."""
    page.wait_for_selector(f"#actions button[data-key='{key}']:not([hidden])")
    page.keyboard.press(key)
    page.wait_for_function(f"() => bench().phase === '{then}'")


def cookie_of(address: str) -> str:
    """Exchange the token for the cookie, as a browser does."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.netloc)
    connection.request("GET", f"/?{parts.query}")
    response = connection.getresponse()
    response.read()
    connection.close()
    assert response.status == 303
    return str(response.headers["Set-Cookie"]).split(";")[0]


@pytest.mark.trials
def test_from_opening_to_the_run_file(record: Callable[..., Any], context: BrowserContext) -> None:
    """Open, see the motion, mark, stop: the mark is shown once the log has it, and the run file holds all of it."""
    program = record()
    page = context.new_page()
    page.goto(program.address)
    page.wait_for_function("() => bench().phase === 'recording'")
    page.wait_for_function(SEEN.format(count=300))
    assert page.inner_text("#source") == "SIMULATED"
    page.wait_for_function(MOVES)
    period = page.evaluate("motion.estimates.period")
    assert period["value"] == pytest.approx(0.7573, abs=0.005)
    assert "If you stop now: T between" in page.inner_text("#stopping")
    page.keyboard.press("m")
    answer(page, "lamp on")
    page.wait_for_function("() => state.marks.length === 1")
    assert "lamp on" in page.inner_text("#marks")
    page.keyboard.press("s")
    answer(page)
    page.wait_for_function("() => bench().phase === 'built'")
    page.keyboard.press("q")
    answer(page)
    assert program.ended() == 0
    page.wait_for_function("() => !document.getElementById('trouble').hidden")
    assert "has ended" in page.inner_text("#trouble")
    with open_run(program.out) as run:
        assert [mark["text"] for mark in run.provenance["marks"]] == ["lamp on"]
        (ended,) = [event["facts"] for event in run.provenance["events"] if event["kind"] == "ended"]
        distance = run.samples().distance
    assert ended["by"] == "the page"
    shown = np.array(page.evaluate("Array.from(samples[0].y.subarray(0, samples[0].count))"), np.float64)
    np.testing.assert_array_equal(shown, distance[: shown.size])
    assert distance.size - shown.size < 50


@pytest.mark.trials
def test_a_killed_page_ends_no_recording(record: Callable[..., Any]) -> None:
    """The page's process is gone; the recording goes on until Ctrl-C, and lacks no reading."""
    program = record()
    found = subprocess.run(
        ["pgrep", "-f", f"springmass page --recorder.* {program.out.with_suffix('.wire')}"],
        capture_output=True,
        text=True,
    )
    (pid,) = found.stdout.split()
    log = program.out.with_suffix(".wire")
    os.kill(int(pid), 9)
    size = log.stat().st_size
    until = time.monotonic() + LIMIT_S
    while log.stat().st_size < size + 4096:
        assert time.monotonic() < until, "nothing more is recorded"
    program.process.send_signal(signal.SIGINT)
    assert program.ended() == 130
    with open_run(program.out) as run:
        samples = run.samples()
    assert np.isfinite(samples.distance).all()
    assert np.diff(samples.t).max() < 0.015


@pytest.fixture
def replay(start: Callable[..., Any], context: BrowserContext) -> Page:
    """Return the page of an old run."""
    program = start("replay", str(springmass.sample_data() / "damped_simulated_position.txt"), "--page")
    page = context.new_page()
    page.goto(program.address)
    page.wait_for_function(SEEN.format(count=11000))
    page.wait_for_function(MOVES)
    return page


def test_a_region_of_an_old_run_is_fitted(replay: Page) -> None:
    """Drawn with the mouse; its period is that of the run within their uncertainties."""
    box = replay.locator("#position .u-over").bounding_box()
    assert box is not None
    middle = box["y"] + box["height"] / 2
    replay.mouse.move(box["x"] + 0.2 * box["width"], middle)
    replay.mouse.down()
    replay.mouse.move(box["x"] + 0.6 * box["width"], middle, steps=5)
    replay.mouse.up()
    replay.wait_for_selector("#region-estimates tr[data-name='period']")
    assert "Selection" in replay.inner_text("#region-title")
    assert replay.locator("#region-fits thead th").all_inner_texts() == ["Fit", "Selection", "Whole run"]
    part, whole = replay.locator("#region-estimates tr[data-name='period'] td").all_inner_texts()
    assert float(part.split("(")[0]) == pytest.approx(0.7901, abs=0.0005)
    assert whole == replay.evaluate("short(motion.estimates.period)")


def test_statistics_of_a_selection_are_those_of_its_samples(replay: Page) -> None:
    """Number, mean, standard deviation, least, greatest and the slope of a straight line, by numpy."""
    samples = springmass.load(springmass.sample_data() / "damped_simulated_position.txt").samples
    part = (samples.t >= 10.0) & (samples.t <= 12.5)
    t, y = samples.t[part], samples.distance[part]
    found = replay.evaluate("statistics({ from: 10, to: 12.5 })")
    expected = {
        "n": t.size,
        "mean": y.mean(),
        "deviation": y.std(ddof=1),
        "least": y.min(),
        "most": y.max(),
        "slope": np.polyfit(t, y, 1)[0],
    }
    assert found == pytest.approx(expected, rel=1e-6)


def test_a_replay_shows_the_numbers_of_its_moment(replay: Page) -> None:
    """At a third of the run those of the samples so far, at its end those of the whole run; a forecast at neither."""
    assert "Standard accuracy, whole run" in replay.inner_text("#tier")
    assert replay.inner_text("#stopping") == ""
    whole = replay.inner_text("#estimates")
    replay.locator("#time").fill("0.333")
    replay.wait_for_function("() => moment && Math.abs(moment.to - play_time) < 0.3")
    assert replay.inner_text("#tier").startswith("Fast accuracy, samples up to ")
    amplitude = replay.evaluate("shown_message().estimates.amplitude_now.value")
    assert amplitude > 1.2 * replay.evaluate("motion.estimates.amplitude_now.value")
    assert replay.inner_text("#estimates") != whole
    assert replay.inner_text("#stopping") == ""
    replay.locator("#time").fill("1")
    replay.wait_for_function("() => moment === null")
    assert replay.inner_text("#estimates") == whole


@pytest.mark.parametrize(
    ("text", "metres"),
    [("0.25 m", 0.25), ("250 mm", 0.25), ("25 cm", 0.25), ("250", 0.25), ("0,25 m", 0.25), (" .25m ", 0.25)],
)
def test_lengths_are_read_with_their_unit(replay: Page, text: str, metres: float) -> None:
    """In m, cm or mm, and a bare number as mm."""
    assert replay.evaluate("(text) => length_between(0.01, 20, '')(text)", text) == pytest.approx(metres)


@pytest.mark.parametrize(
    ("text", "says"),
    [("0.25", "Did you mean 0.25 m?"), ("abc", "Cannot read"), ("25 ft", "Cannot read"), ("", "Cannot read")],
)
def test_a_length_that_cannot_be_is_named(replay: Page, text: str, says: str) -> None:
    """With what was written, and what to write."""
    error = replay.evaluate(
        "(t) => { try { length_between(0.01, 20, '25 cm')(t); } catch (e) { return e.message; } }", text
    )
    assert says in error


def test_an_old_run_is_played(replay: Page) -> None:
    """Space plays and pauses, the scrub bar moves, and nothing is recorded: no mark, no stop."""
    assert replay.inner_text("#source") == "SIMULATED · REPLAY"
    assert replay.is_hidden("#mark")
    assert replay.is_hidden("#stop")
    replay.select_option("#speed", "5")
    replay.keyboard.press(" ")
    replay.wait_for_function("() => play_time > samples[0].t[0] + 2")
    replay.keyboard.press(" ")
    assert not replay.evaluate("playing")
    replay.locator("#time").fill("0.5")
    half = replay.evaluate("play_time / (samples[0].t[0] + samples[0].t[samples[0].count - 1])")
    assert half == pytest.approx(0.5, abs=0.01)


def test_the_end_of_an_old_run_is_its_beginning_where_it_loops(replay: Page) -> None:
    """Without the loop it stays at its last sample; with it what is shown begins anew, and plays on."""
    last = "samples[0].t[samples[0].count - 1]"
    replay.select_option("#speed", "20")
    replay.locator("#time").fill("0.995")
    replay.keyboard.press(" ")
    replay.wait_for_function("() => !playing")
    assert replay.evaluate(f"play_time === {last}")
    replay.check("#loop")
    replay.locator("#time").fill("0.995")
    replay.keyboard.press(" ")
    replay.wait_for_function(f"() => play_time < {last} / 2")
    assert replay.evaluate("playing")
    replay.wait_for_function("() => position.plot.data[0].at(-1) < 20")


def test_what_is_in_view_is_saved(replay: Page, tmp_path: Path) -> None:
    """As CSV, cell for cell what was recorded."""
    with replay.expect_download() as download:
        replay.keyboard.press("c")
    path = tmp_path / "view.csv"
    download.value.save_as(path)
    with path.open() as file:
        rows = list(csv.reader(file))
    recorded = springmass.load(springmass.sample_data() / "damped_simulated_position.txt").samples
    assert rows[0] == ["time_s", "distance_m"]
    assert len(rows) == len(recorded) + 1
    np.testing.assert_array_equal([float(row[0]) for row in rows[1:]], recorded.t)


@pytest.mark.trials
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1366, 390])
def test_everybody_can_read_it(replay: Page, width: int, scheme: Any) -> None:
    """No violation of the accessibility rules, nothing wider than the screen, the keys named on wide ones."""
    replay.emulate_media(color_scheme=scheme)
    replay.set_viewport_size({"width": width, "height": 844})
    replay.wait_for_function(f"() => document.querySelector('#position canvas').clientWidth < {width}")
    found = Axe().run(replay)
    assert found.violations_count == 0, found.generate_report()
    assert replay.evaluate("document.documentElement.scrollWidth") <= width
    assert replay.locator("#freeze kbd").is_visible() == (width > 700)
    if folder := os.environ.get("SPRINGMASS_SCREENSHOTS"):
        replay.screenshot(path=Path(folder) / f"bench-page-{width}-{scheme}.png", full_page=True)


def test_by_night_the_same_charts_are_drawn(replay: Page) -> None:
    """Where the run was shown anew, a change of colours draws its charts again and none of those before them."""
    replay.evaluate("begin_anew()")
    replay.emulate_media(color_scheme="dark")
    replay.wait_for_function("() => position.plot.axes[0].stroke() === '#ededed'")
    for chart in ("position", "amplitude", "phase", "spectrum"):
        assert replay.locator(f"div#{chart} .uplot").count() == 1
        assert replay.evaluate(f"{chart}.plot.root === document.querySelector('div#{chart} .uplot')")
    for label in ("sampling rate", "drop-outs"):
        assert label in replay.inner_text("#estimates")


def test_two_hours_are_drawn_by_least_and_greatest(replay: Page) -> None:
    """720,000 samples become as many points as the screen can show, and no spike among them is lost."""
    points, least, greatest, gaps = replay.evaluate("""() => {
      const all = new Samples(), n = 720000, t = new Float64Array(n), y = new Float64Array(n);
      for (let i = 0; i < n; i++) { t[i] = i / 100; y[i] = Math.sin(i / 12); }
      y[123456] = 7; y[654321] = -9; y.fill(NaN, 300000, 310000);
      all.take(0, t, y);
      const [times, shown] = all.between(0, 7200, 1000);
      const known = shown.filter((v) => v !== null);
      return [times.length, Math.min(...known), Math.max(...known), shown.length - known.length];
    }""")
    assert points <= 2100
    assert (least, greatest) == (-9, 7)
    assert gaps > 10


def test_every_key_has_its_button(replay: Page) -> None:
    """Freeze and fixed axes are pressed or not, the window goes round, and speech is written too."""
    for key, button in (("f", "freeze"), ("a", "axes")):
        replay.keyboard.press(key)
        assert replay.get_attribute(f"#{button}", "aria-pressed") == "true"
        replay.locator(f"#{button}").click()
        assert replay.get_attribute(f"#{button}", "aria-pressed") == "false"
    assert replay.inner_text("#window").startswith("all")
    replay.keyboard.press("w")
    assert replay.inner_text("#window").startswith("5 s")
    replay.keyboard.press("v")
    assert replay.inner_text("#said").startswith("Period 0.790 seconds")


@pytest.mark.trials
def test_two_look_and_a_stranger_does_not(record: Callable[..., Any], browser: Any, context: BrowserContext) -> None:
    """The cookie opens a second page in the same browser; another browser, host or origin gets nothing."""
    program = record()
    first, second = context.new_page(), context.new_page()
    first.goto(program.address)
    second.goto(program.address.partition("?")[0])
    for page in (first, second):
        page.wait_for_function(SEEN.format(count=50))
    stranger = browser.new_context()
    assert stranger.new_page().goto(program.address).status == 403
    stranger.close()
    netloc = urlsplit(program.address).netloc
    connection = http.client.HTTPConnection(netloc)
    connection.request("GET", "/", headers={"Host": "evil.example"})
    assert connection.getresponse().status == 400
    connection.close()
    with pytest.raises(InvalidStatus):
        connect(f"ws://{netloc}/v1/run", origin="http://evil.example")  # type: ignore[arg-type]
    program.end()


@pytest.mark.trials
def test_the_client_of_the_documentation(record: Callable[..., Any]) -> None:
    """The ten lines of docs/reference/page-messages.md run as they stand and print the samples."""
    program = record()
    page = (Path(__file__).parents[2] / "docs/reference/page-messages.md").read_text()
    client = page.split("## An example client")[1].split("```python\n")[1].split("```")[0]
    assert len([line for line in client.splitlines() if line and not line.startswith(("import", "from"))]) <= 10
    client = re.sub(r'"http://127[^"]*"', repr(program.address), client)
    with subprocess.Popen([sys.executable, "-u", "-c", client], stdout=subprocess.PIPE, text=True) as reading:
        assert reading.stdout is not None
        printed: list[str] = []
        while not {"hello", "state"} <= set(printed) or not any(line.startswith("[") for line in printed):
            line = reading.stdout.readline()
            assert line, "the client ended"
            printed.append(line.strip())
        reading.kill()
    assert printed[0] == "hello"
    program.end()


@pytest.mark.trials
def test_a_client_of_ten_lines(record: Callable[..., Any]) -> None:
    """As docs/reference/page-messages.md has it; a message that means nothing closes the connection."""
    program = record()
    cookie, netloc = cookie_of(program.address), urlsplit(program.address).netloc
    with connect(f"ws://{netloc}/v1/run", origin=f"http://{netloc}", additional_headers={"Cookie": cookie}) as run:  # type: ignore[arg-type]
        hello = json.loads(run.recv())
        assert (hello["type"], hello["version"], hello["simulated"]) == ("hello", 1, True)
        count = 0
        while count < 100:
            message = run.recv()
            if isinstance(message, bytes):
                kind, sensor, first, size = struct.unpack_from("<4I", message)
                t = np.frombuffer(message, "<f8", size, 16)
                assert (kind, sensor, first) == (1, 0, count)
                assert np.all(np.diff(t) > 0)
                count += size
        run.send('{"type": "mark", "text": "from a script"}')
        while True:
            message = run.recv()
            if isinstance(message, str) and json.loads(message).get("marks"):
                break
        assert json.loads(message)["marks"][0][1] == "from a script"
        run.send('{"type": "rm"}')
        with pytest.raises(ConnectionClosedError):
            for _ in run:
                pass
        assert run.close_code == 1003
    program.end()
