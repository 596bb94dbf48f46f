"""The way of a student: analyse a recording on a terminal, read the report, print it; screenshots are kept.

``SPRINGMASS_SCREENSHOTS=DIR python -m pytest -m trials tests/pages/test_students_way.py`` keeps them in DIR.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser

from springmass.runs.loading import sample_data
from tests.screen import OnTerminal

pytestmark = [
    pytest.mark.trials,
    pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are POSIX's"),
]
SIZES = {"laptop": (1366, 768), "tablet": (768, 1024), "phone": (390, 844)}


def test_from_a_recording_to_a_printed_report(browser: Browser, tmp_path: Path) -> None:
    """Analyse without masses, answer what is asked, look at the report on every screen and on paper."""
    kept = Path(os.environ.get("SPRINGMASS_SCREENSHOTS", tmp_path / "kept"))
    kept.mkdir(parents=True, exist_ok=True)
    recording = tmp_path / "run.txt"
    recording.write_bytes((sample_data() / "clipped_simulated_position.txt").read_bytes() + b"\n")
    with OnTerminal(["analyse", "run.txt", "--no-report"], tmp_path) as terminal:
        assert terminal.end() == 0
    (kept / "terminal-1.txt").write_text(terminal.screen.text)
    assert "needs the mass: --mass-kg KG" in terminal.screen.text
    assert len(terminal.screen.text.splitlines()) <= 30
    with OnTerminal(["analyse", "run.txt", "--ask"], tmp_path) as terminal:
        for question, answer in (("Mass of all", "200.7 g +- 0.1"), ("Mass of the spring", "10 g"), ("Diameter", "")):
            terminal.until(question)
            terminal.type(f"{answer}\r")
        assert terminal.end() == 0
    (kept / "terminal-2.txt").write_text(terminal.screen.text)
    assert "spring constant" in terminal.screen.text
    assert (tmp_path / "run.about.toml").is_file()
    with OnTerminal(["explain", "clipped"], tmp_path) as terminal:
        assert terminal.end() == 0
    assert "Advice:" in terminal.screen.text
    report = tmp_path / "run.results" / "report.html"
    for name, (width, height) in SIZES.items():
        for scheme in ("light", "dark"):
            context = browser.new_context(
                viewport={"width": width, "height": height},
                color_scheme="dark" if scheme == "dark" else "light",
                offline=True,
            )
            page = context.new_page()
            page.goto(report.as_uri())
            page.screenshot(path=kept / f"report-{name}-{scheme}.png")
            page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            page.wait_for_timeout(300)
            page.screenshot(path=kept / f"report-{name}-{scheme}-open.png", full_page=True)
            assert Axe().run(page).response["violations"] == [], (name, scheme)
            if (name, scheme) == ("laptop", "light"):
                page.pdf(path=kept / "report.pdf", prefer_css_page_size=True)
            context.close()
    assert (kept / "report.pdf").read_bytes().startswith(b"%PDF")
