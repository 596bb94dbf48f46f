"""The page of a course on a laptop, a phone and paper, through a screen reader, and sorted."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser

from springmass.cli import main
from tests.courses import damped, write_recording
from tests.pages.test_pages import WIDTHS

TAGS = "path,section,bob_mass_kg,air_temperature_c,disc_diameter_m\nrun0.txt,mon,0.2,20,0.1\nrun1.txt,tue,0.21,20,0.1\n"


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of three runs, one at rest and one that cannot be read."""
    top = tmp_path_factory.mktemp("course")
    runs = top / "runs"
    runs.mkdir()
    for i in range(3):
        write_recording(runs / f"run{i}.txt", damped(i, omega=8.0 + 0.1 * i))
    write_recording(runs / "still.txt", 0.2 + 3e-4 * np.random.default_rng(1).standard_normal(800))
    (runs / "bad.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 600)
    (top / "runs.csv").write_text(TAGS.replace("\nrun", "\nruns/run"))
    out = top / "out"
    arguments = ["batch", str(runs), "--runs", str(top / "runs.csv"), "-o", str(out), "--jobs", "1", "--reports", "1"]
    assert main([*arguments, "--accuracy", "fast"]) == 1
    return out / "index.html"


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_of_a_course_is_clipped(clipped: Callable[..., list[str]], course: Path, width: str) -> None:
    """Nothing lies outside the medium or is cut off."""
    assert clipped(course, width) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation_on_the_page_of_a_course(browser: Browser, course: Path, scheme: str) -> None:
    """By axe-core the page is accessible, by day and by night."""
    page = browser.new_page(viewport={"width": 1366, "height": 768}, offline=True)
    page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
    page.goto(course.as_uri())
    found = Axe().run(page).response["violations"]
    assert found == [], json.dumps([(x["id"], x["help"], [n["html"][:160] for n in x["nodes"][:3]]) for x in found])
    page.close()


def test_runs_sort_and_are_filtered(browser: Browser, course: Path) -> None:
    """Those that need a look first; by the period up and down, what has none last; only those that contain a word."""
    page = browser.new_page(offline=True)
    page.goto(course.as_uri())
    names = page.locator("tbody th")
    assert names.all_text_contents()[:2] == ["bad", "still"]
    page.get_by_role("button", name="T", exact=True).click()
    assert names.all_text_contents()[:3] == ["run2", "run1", "run0"]
    page.get_by_role("button", name="T", exact=True).click()
    assert names.all_text_contents()[:3] == ["run0", "run1", "run2"]
    page.get_by_label("Show runs that contain").fill("TUE")
    assert page.locator("tbody tr:visible th").all_text_contents() == ["run1"]
    assert page.get_by_role("status").text_content() == "1 of 5 runs"
    page.get_by_label("Show runs that contain").fill("")
    page.locator("tbody a").click()
    page.wait_for_url("**/report.html")
    page.close()
