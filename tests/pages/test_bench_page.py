"""The page of an old run as its user meets it: selections, cursors, play, charts, what is saved."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

import springmass
from tests.pages.bench import OLD_RUN
from tests.sampling import sampled

# The old run is served once for all tests; each opens its page anew.


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
    samples = springmass.load(OLD_RUN).loaded.samples
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


def test_what_is_in_view_is_saved(replay: Page, tmp_path: Path) -> None:
    """As CSV, cell for cell what was recorded."""
    with replay.expect_download() as download:
        replay.keyboard.press("c")
    path = tmp_path / "view.csv"
    download.value.save_as(path)
    with path.open() as file:
        rows = list(csv.reader(file))
    recorded = springmass.load(OLD_RUN).loaded.samples
    assert rows[0] == ["time_s", "distance_m"]
    assert len(rows) == len(recorded) + 1
    np.testing.assert_array_equal([float(row[0]) for row in rows[1:]], recorded.t)


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


def test_lengths_are_read_with_their_unit(replay: Page) -> None:
    """In m, cm or mm, and a bare number as mm; what cannot be read is refused."""
    read = """(text) => { try { return length_between(0.01, 20, '25 cm')(text); } catch (error) { return null; } }"""
    for text in ("0.25 m", "250 mm", "25 cm", "250", "0,25 m", " .25m "):
        assert replay.evaluate(read, text) == pytest.approx(0.25), text
    for text in ("0.25", "abc", "25 ft", ""):
        assert replay.evaluate(read, text) is None, text


def test_an_old_run_is_played(replay: Page) -> None:
    """Space plays and pauses, the scrub bar moves, and at the end the run begins anew where it loops."""
    last = "samples[0].t[samples[0].count - 1]"
    assert replay.inner_text("#source") == "SIMULATED · REPLAY"
    assert replay.is_hidden("#mark")
    assert replay.is_hidden("#stop")
    replay.select_option("#speed", "20")
    replay.keyboard.press(" ")
    replay.wait_for_function("() => play_time > samples[0].t[0] + 2")
    replay.keyboard.press(" ")
    assert not replay.evaluate("playing")
    replay.locator("#time").fill("0.995")
    replay.keyboard.press(" ")
    replay.wait_for_function("() => !playing")
    assert replay.evaluate(f"play_time === {last}")
    replay.check("#loop")
    replay.locator("#time").fill("0.995")
    replay.keyboard.press(" ")
    replay.wait_for_function(f"() => play_time < {last} / 2")
    assert replay.evaluate("playing")


def test_the_cursor_and_a_part_by_the_keyboard(replay: Page) -> None:
    """X puts the cursor, arrows move it, Enter pins it, G has the part between fitted; arrows scrub without it."""
    replay.keyboard.press("x")
    replay.keyboard.press("Enter")
    for _ in range(20):
        replay.keyboard.press("Shift+ArrowRight")
    assert "slope" in replay.inner_text("#cursor")
    replay.keyboard.press("g")
    cell = replay.wait_for_selector("#region-estimates tr[data-name='period'] td")
    assert cell is not None
    assert float(cell.inner_text().split("(")[0]) == pytest.approx(0.7901, abs=0.001)
    replay.keyboard.press("x")
    assert replay.inner_text("#cursor") == ""
    replay.keyboard.press("ArrowLeft")
    assert replay.evaluate("play_time") == pytest.approx(replay.evaluate("samples[0].t[samples[0].count - 1]") - 1.0)


@pytest.mark.parametrize(
    ("width", "scheme"), sampled([(1366, "light"), (390, "dark"), (390, "light"), (1366, "dark")], 1)
)
def test_everybody_can_read_it(replay: Page, width: int, scheme: Any) -> None:
    """No violation of the accessibility rules, and nothing wider than the screen."""
    replay.emulate_media(color_scheme=scheme)
    replay.set_viewport_size({"width": width, "height": 844})
    replay.wait_for_function(f"() => document.querySelector('#position canvas').clientWidth < {width}")
    found = Axe().run(replay)
    assert found.violations_count == 0, found.generate_report()
    assert replay.evaluate("document.documentElement.scrollWidth") <= width
