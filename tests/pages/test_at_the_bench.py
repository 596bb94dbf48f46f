"""What is done at the bench on the page: every step is shown once the recorder has acknowledged it."""

import json
import os
import re
import signal
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from storage.run_file.reading import open_run
from tests.pages.bench import LIMIT_S, MOVES, PHASE, SEEN, Client, answer, opened, press

LOST_ONCE = """() => {
  const trouble = document.getElementById('trouble');
  window.lost_once = false;
  new MutationObserver(() => { if (!trouble.hidden) window.lost_once = true; }).observe(trouble, { attributes: true });
}"""


@pytest.fixture
def bench(record: Callable[..., Any], context: BrowserContext) -> tuple[Any, Page]:
    """Return a bench that is ready, and its page."""
    program = record("--ready")
    return program, opened(context, program.address, PHASE.format(phase="ready"))


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
    with open_run(program.out.parent / "discarded" / "run.h5") as run:
        assert {"text": "new spring"} in [event["facts"] for event in run.provenance["events"]]
    assert "table was pushed" in (program.out.parent / "discarded" / "run.about.toml").read_text()


@pytest.mark.trials
def test_nothing_is_recorded_where_the_page_is_closed_before(bench: tuple[Any, Page]) -> None:
    """The program ends with 0 and leaves nothing."""
    program, page = bench
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    assert not program.out.exists()
    assert "nothing was recorded" in "".join(program.messages)


@pytest.fixture
def viewers(record: Callable[..., Any], context: BrowserContext) -> tuple[Any, Page, str]:
    """Return a recording that is open to viewers, its page, and their address."""
    program = record("--lan")
    page = opened(context, program.address, PHASE.format(phase="recording"))
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
    assert Client(address).code_after('{"type": "mark", "text": "no"}') == 1003
    assert page.evaluate("bench().phase") == "recording"
    program.end()


def test_from_opening_to_the_run_file(record: Callable[..., Any], context: BrowserContext) -> None:
    """Open, see the motion, mark, stop: a mark is shown once the log has it, and the run file holds all of it.

    A script gets the same as messages, as docs/reference/page-messages.md has them, and may mark.
    """
    program = record()
    mark_by_script(program.address)
    page = opened(context, program.address, PHASE.format(phase="recording"))
    assert page.inner_text("#source") == "SIMULATED"
    press(page, "m")
    answer(page, "lamp on")
    page.wait_for_function("() => state.marks.length === 2")
    page.wait_for_function(MOVES)
    assert page.evaluate("motion.estimates.period.value") == pytest.approx(0.7573, abs=0.01)
    press(page, "s")
    answer(page)
    page.wait_for_function(PHASE.format(phase="built"))
    press(page, "q")
    answer(page)
    assert program.ended() == 0
    page.wait_for_function("() => !document.getElementById('trouble').hidden")
    with open_run(program.out) as run:
        assert [mark["text"] for mark in run.provenance["marks"]] == ["from a script", "lamp on"]
        (ended,) = [event["facts"] for event in run.provenance["events"] if event["kind"] == "ended"]
        distance = run.samples().distance
    assert ended["by"] == "the page"
    shown = np.array(page.evaluate("Array.from(samples[0].y.subarray(0, samples[0].count))"), np.float64)
    np.testing.assert_array_equal(shown, distance[: shown.size])
    assert distance.size - shown.size < 50


def mark_by_script(address: str) -> None:
    """Take samples as messages, in order and without a gap, and mark."""
    with Client(address).socket() as run:
        hello = json.loads(run.recv())
        assert (hello["type"], hello["version"], hello["simulated"]) == ("hello", 2, True)
        count = 0
        while count < 50:
            message = run.recv()
            if isinstance(message, bytes):
                kind, sensor, first, size = struct.unpack_from("<4I", message)
                assert (kind, sensor, first) == (1, 0, count)
                assert np.all(np.diff(np.frombuffer(message, "<f8", size, 16)) > 0)
                count += size
        run.send('{"type": "mark", "text": "from a script"}')
        while not (isinstance(message, str) and json.loads(message).get("marks")):
            message = run.recv()
        assert json.loads(message)["marks"][0][1] == "from a script"


@pytest.mark.trials
def test_the_amplitude_is_newer_than_the_analysis(record: Callable[..., Any]) -> None:
    """Between two analyses the motion is sent again: with the amplitude of the last seconds, and without charts."""
    program = record()
    of_count: dict[int, dict[str, Any]] = {}
    with Client(program.address).socket() as run:
        while True:
            message = run.recv(timeout=LIMIT_S)
            if not isinstance(message, str) or (motion := json.loads(message))["type"] != "motion":
                continue
            first = of_count.setdefault(motion["count"], motion)
            if motion is not first and "charts" in first:
                break
    assert "charts" not in motion
    assert motion["estimates"]["amplitude_now"].pop("t_s") > motion["t_s"] == first["t_s"]
    for sent in (first, motion):
        assert sent["estimates"].pop("amplitude_now")["u"] > 0.0
    del first["charts"]
    assert motion == first
    program.end()


@pytest.mark.trials
def test_the_client_of_the_documentation(record: Callable[..., Any]) -> None:
    """The ten lines of docs/reference/page-messages.md run as they stand and print the samples."""
    program = record()
    page = (Path(__file__).parents[2] / "docs/reference/page-messages.md").read_text()
    client = page.split("## An example client")[1].split("```python\n")[1].split("```")[0]
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


@pytest.mark.trials
def test_a_killed_page_ends_no_recording(record: Callable[..., Any], start: Callable[..., Any]) -> None:
    """The recording goes on and lacks no reading; a sentence says how to open the page, which shows the rest."""
    program = record()
    log = program.out.with_suffix(".wire")
    kill_page_of(program)
    size = log.stat().st_size
    while log.stat().st_size < size + 4096:
        assert program.process.poll() is None, "".join(program.messages)
    (said,) = [line for line in program.messages if "the page has ended" in line]
    assert f"`springmass page {log}`" in said
    again = start("page", str(log))
    with Client(again.address).socket() as watching:
        assert json.loads(watching.recv())["name"] == "run.h5"
    assert program.end() == 130
    assert again.end() == 0
    program.whole_run()


@pytest.mark.trials
def test_a_killed_page_ends_a_bench_that_waits_for_it(bench: tuple[Any, Page]) -> None:
    """Nothing could begin the recording any more: the program says so, and ends with the code of an internal error."""
    program, _ = bench
    kill_page_of(program)
    assert program.ended() == 70
    assert "the page has ended" in "".join(program.messages)
    assert not program.out.exists()


def kill_page_of(program: Any) -> None:
    """Kill the process of a recording's page."""
    command = f"springmass page .*{program.out.with_suffix('.wire')}"
    found = subprocess.run(["pgrep", "-f", command], capture_output=True, text=True)
    os.kill(int(found.stdout), signal.SIGKILL)
