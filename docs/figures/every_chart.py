"""Draw every chart once, at two widths, on a light and a dark background, into one page to look at.

``python docs/figures/every_chart.py`` writes ``docs/_build/charts/index.html``. Somebody who did not draw a chart
should find no two entries of a legend alike, no text cut, and no line that hides another unnamed.
"""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser

from springmass import sample_data
from tests.browser import headless

TARGET = Path(__file__).resolve().parents[1] / "_build" / "charts"
WIDTHS, SCHEMES = (1280, 390), ("light", "dark")
CHARTS = {
    "report": ("position", "amplitude", "frequency", "spectrum", "drag", "energy", "motion", "phase", "contour"),
    "classic": ("classic",),
    "comparison": ("overlay", "comparison", "masses", "hooke"),
    "simulation": ("position", "velocity", "energy", "phase", "error", "band", "against"),
    "course": ("course", "drag-map"),
}
"""The charts by the page that has them."""
SCENE = """
[bob]
mass_kg = {{ value = {mass}, u = 0.00005 }}
[spring]
constant_n_per_m = 14.0
mass_kg = {{ value = 0.010, u = 0.0005 }}
[disc]
diameter_m = {{ value = {disc}, u = 0.0005 }}
[air]
temperature_c = 20.0
[start]
displacement_m = 0.05
"""
BENCHES = {"120": (0.12, 0.08), "160": (0.16, 0.08), "200": (0.2, 0.1), "240": (0.24, 0.1), "280": (0.28, 0.12)}
"""Mass of the bob, kg, and diameter of the disc, m, by the name of the run."""


def springmass(folder: Path, *arguments: str | Path) -> None:
    """Run the program in a folder."""
    command = [sys.executable, "-m", "springmass", "-q", *map(str, arguments)]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def pages(folder: Path) -> Iterator[tuple[str, Path]]:
    """Write the pages into a folder; yield the name of each and its file."""
    data = sample_data()
    run, scene = data / "damped_simulated_position.txt", data / "damped.scene.toml"
    springmass(folder, "analyse", run, "--scene", scene, "--method", "classic", "--figures", "svg", "-o", "one")
    report = folder / "one" / f"{run.name}.results" / "report.html"
    yield from (("report", report), ("classic", report))
    with (folder / "runs.csv").open("w", newline="") as table:
        rows = csv.writer(table)
        rows.writerow(("path", "disc", "group"))
        for i, (name, (mass, disc)) in enumerate(BENCHES.items()):
            (folder / f"{name}.toml").write_text(SCENE.format(mass=mass, disc=disc))
            springmass(folder, "simulate", "--scene", f"{name}.toml", "--seconds", "60", "-o", f"{name}.h5")
            rows.writerow((f"{name}.h5", f"{1000 * disc:.0f} mm", "AB"[i % 2]))
    (folder / "hooke.csv").write_text("mass (g),position (cm)\n120,80.90\n160,78.20\n200,75.30\n240,72.50\n280,69.77\n")
    recordings = [f"{name}.h5" for name in BENCHES]
    springmass(folder, "compare", *recordings, "--hooke", "hooke.csv", "-o", "masses")
    yield "comparison", folder / "masses" / "report.html"
    springmass(folder, "simulate", "--scene", "200.toml", "--against", "200.h5", "--check", "-o", "simulated")
    yield "simulation", next((folder / "simulated").rglob("simulation.html"))
    springmass(folder, "batch", *recordings, "--runs", "runs.csv", "-o", "course")
    yield "course", folder / "course" / "index.html"


def pictures(browser: Browser, page: Path, kind: str) -> Iterator[tuple[str, str]]:
    """Take the charts of a page; yield the title and the file of each picture."""
    for width, scheme in product(WIDTHS, SCHEMES):
        view = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme, has_touch=width < 500)
        view.goto(page.as_uri())
        view.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
        view.locator("figure .panel canvas").first.wait_for()
        for name in CHARTS[kind]:
            file = f"{kind}-{name}-{width}-{scheme}.png"
            view.locator(f"figure.{name}").first.screenshot(path=TARGET / file)
            yield f"{kind}: {name}, {width} px, {scheme}", file
        view.close()


def main() -> Path:
    """Write the page and return its file."""
    TARGET.mkdir(parents=True, exist_ok=True)
    with headless() as browser, TemporaryDirectory() as folder:
        taken = sorted(each for kind, page in pages(Path(folder)) for each in pictures(browser, page, kind))
    shown = (f'<figure><figcaption>{title}</figcaption><img src="{file}" alt=""></figure>' for title, file in taken)
    index = TARGET / "index.html"
    index.write_text(f"<!DOCTYPE html>\n<title>Every chart</title>\n{chr(10).join(shown)}\n", encoding="utf-8")
    return index


if __name__ == "__main__":
    print(main())
