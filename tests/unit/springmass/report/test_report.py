"""The report of a run: its files, the numbers in them, and what must never stand in its page."""

import json
import re
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from springmass.charts.chart import to_json
from springmass.charts.run import charts_of
from springmass.cli import main
from tests.courses import rows_of

DATA = springmass.sample_data()


def reported(recording: Path, out: Path, *options: str) -> Path:
    """Analyse a recording; return the folder of its report."""
    main(["analyse", str(recording), "--output", str(out), *options])
    return out / f"{recording.name}.results"


def files_in(folder: Path) -> set[str]:
    """Return the names of every file below a folder."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def table(path: Path, y: np.ndarray, heading: str = "distance (m)") -> Path:
    """Write distances at 100 Hz as a CSV."""
    rows = "".join(f"{i / 100:.2f},{value:.6f}\n" for i, value in enumerate(y))
    path.write_text(f"time (s),{heading}\n{rows}", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of two minutes of a damped bob in a known scene."""
    recording, out = DATA / "damped_simulated_position.txt", tmp_path_factory.mktemp("report")
    return reported(recording, out, "--scene", str(DATA / "damped.scene.toml"))


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    """The page of that report."""
    return (folder / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def result(folder: Path) -> dict[str, Any]:
    """What the analysis states, as JSON."""
    stated: dict[str, Any] = json.loads((folder / "results.json").read_text("utf-8"))
    return stated


def test_figures_are_written_on_request(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As files, and in the page for viewers without scripts, even if MPLBACKEND names nothing that exists."""
    monkeypatch.setenv("MPLBACKEND", "nonsense")
    folder = reported(DATA / "undamped_simulated_position.txt", tmp_path, "--figures", "svg")
    figures = {name for name in files_in(folder) if name.startswith("figures/")}
    assert {"figures/position.svg", "figures/amplitude.svg", "figures/contour.svg"} <= figures
    assert all(ElementTree.parse(folder / name).getroot().tag.endswith("svg") for name in figures)
    page = (folder / "report.html").read_text("utf-8")
    assert page.count("data:image/svg+xml") == len(figures)
    assert main(["analyse", str(DATA / "undamped_simulated_position.txt"), "--figures", "gif"]) == 2


def test_the_page_needs_nothing_from_outside(page: str) -> None:
    """The page refers to no other file and to no network, and two minutes at 100 Hz take at most 500 kB."""
    assert re.search(r"<script[^>]*src|<link|<iframe|@import", page) is None
    markup = re.sub(r"(<script[^>]*>).*?(</script>)", r"\1\2", page, flags=re.DOTALL)
    assert re.search(r"https?://", markup) is None
    references = re.findall(r'(?:src|href|data)="([^"]*)"|url\(([^)]*)\)', markup)
    assert {(a or b)[:5] for a, b in references if not (a or b).startswith("#")} <= {"data:"}
    assert len(page.encode()) <= 500_000


def test_the_charts_of_the_page_are_those_of_the_analysis(page: str) -> None:
    """Each figure has its chart as JSON in the page, byte by byte what the charts of the analysis are."""
    (text,) = re.findall(r'<script type="application/json" id="charts">(.*?)</script>', page, re.DOTALL)
    shown = {chart.pop("file"): chart for chart in json.loads(text)}
    analysis = springmass.analyse(DATA / "damped_simulated_position.txt", scene=DATA / "damped.scene.toml").analysis
    expected = {name: json.loads(json.dumps(to_json(chart))) for name, chart in charts_of(analysis).items()}
    assert shown == expected
    assert len(re.findall("<figure ", page)) == len(shown) == 8


def test_the_tables_hold_every_number_of_the_analysis(folder: Path, result: dict[str, Any]) -> None:
    """results.csv gives each estimate back to its last digit, budget.csv each contribution."""
    read = {row["name"]: (float(row["value"]), float(row["u"]), row["unit"]) for row in rows_of(folder / "results.csv")}
    assert {name: read[name] for name in result["estimates"]} == {
        name: (x["value"], x["u"], x["unit"]) for name, x in result["estimates"].items()
    }
    shares: dict[str, float] = {}
    for row in rows_of(folder / "budget.csv"):
        shares[row["quantity"]] = shares.get(row["quantity"], 0.0) + float(row["contribution"]) ** 2
    assert shares["spring_constant"] ** 0.5 == pytest.approx(result["estimates"]["spring_constant"]["u"], rel=0.01)


def test_the_motion_is_written_at_every_sample(folder: Path, result: dict[str, Any]) -> None:
    """motion.csv has a row for each sample; its velocity is the derivative of its position."""
    samples = springmass.load(DATA / "damped_simulated_position.txt").loaded.samples
    rows = rows_of(folder / "motion.csv")
    t, y, used, position, velocity = (
        np.array([float(row[name]) for row in rows])
        for name in ("time_s", "distance_m", "used", "position_m", "velocity_m_per_s")
    )
    np.testing.assert_allclose(t, samples.t, atol=1e-9)
    np.testing.assert_allclose(y, samples.distance, atol=1e-9)
    assert used.sum() == result["quality"]["used"]
    assert np.abs(np.gradient(position, t) - velocity)[1:-1].max() < 2e-3 * np.abs(velocity).max()


def test_amplitudes_and_phases_of_windows_are_written(folder: Path) -> None:
    """amplitude.csv follows the true amplitude within its u, and its phase turns once in a true period."""
    truth = json.loads((DATA / "damped_simulated.truth.json").read_text("utf-8"))["truth"]
    rows = [row for row in rows_of(folder / "amplitude.csv") if row["used"] == "1"]
    t, amplitude, u, phase = (
        np.array([float(row[name]) for row in rows]) for name in ("time_s", "amplitude_m", "u_amplitude_m", "phase_rad")
    )
    gamma, beta, start = (truth[name]["value"] for name in ("gamma", "beta", "amplitude"))
    decay = np.exp(-gamma * t)
    true = start * decay / (1.0 + beta * start * (1.0 - decay) / gamma)
    assert len(rows) > 100
    assert np.mean(np.abs(amplitude - true) < 2.0 * u) > 0.9
    turns = (phase[-1] - phase[0]) / (2.0 * np.pi)
    assert (t[-1] - t[0]) / turns == pytest.approx(truth["period"]["value"], rel=1e-4)


def test_table_1_is_ready_for_a_spreadsheet(page: str, result: dict[str, Any]) -> None:
    """Each value has cells of its own for value and u, with the digits of u."""
    cells = [each.split("|") for each in re.findall(r'<td class="num"[^>]* data-cells="([^"]*)"', page)]
    period = result["estimates"]["period"]
    (value, u) = next((value, u) for value, u, unit in cells if unit == "s" and float(value) > 0.7)
    assert abs(float(value) - period["value"]) < 0.5e-6
    assert float(u) == pytest.approx(period["u"], rel=0.05)
    assert value.split(".")[1].isdigit()
    assert len(value.split(".")[1]) == len(u.split(".")[1])


def test_correlations_are_shown_as_a_triangle(page: str, result: dict[str, Any]) -> None:
    """The page has the correlations of the JSON to two decimals: of the last row, that of γ and β."""
    rows = re.findall(r"<tr>.*?</tr>", page.partition('<table class="correlations')[2].partition("</table>")[0], re.S)
    shown = [[float(x.replace("−", "-")) for x in re.findall(r"<td[^>]*>([^<]*)</td>", row)] for row in rows]
    names, matrix = result["correlations"]["names"], result["correlations"]["matrix"]
    assert [len(row) for row in shown] == list(range(len(rows)))
    assert shown[-1][-1] == round(matrix[names.index("beta")][names.index("gamma")], 2) < -0.5


def grades_in(page: str) -> dict[str, str]:
    """Return what Table 1 says of each quantity: may it be quoted?"""
    row = r'<tr><th scope="row">([^<]*)</th>(?:(?!</tr>).)*<td class="grade ([a-z-]+)">'
    return dict(re.findall(row, page.partition("</table>")[0]))


def test_table_1_says_what_may_be_quoted(page: str, tmp_path: Path) -> None:
    """Once for all if every value is sound; else for each, with all reasons, and for no value that does not depend."""
    assert not grades_in(page)
    assert "Every value may be quoted." in page
    y = np.loadtxt(DATA / "damped_simulated_position.txt", skiprows=2, usecols=1)[:2000] / 100.0
    rows = "".join(f"{i / 100:.2f},{value:.6f}\n" for i, value in enumerate(y))
    (tmp_path / "run.csv").write_text(f"time,distance (m)\n{rows}", encoding="utf-8")
    assumed = (reported(tmp_path / "run.csv", tmp_path, "--mass-kg", "0.2") / "report.html").read_text("utf-8")
    grades = grades_in(assumed)
    assert {grades[name] for name in ("period", "frequency", "spring constant")} == {"uncertain"}
    assert {grades[name] for name in ("amplitude at the start", "rest position")} == {"sound"}
    reasons = next(x for x in re.findall(r"k \(([^)]*)\)", assumed) if "assumed" in x)
    assert "mass of the spring" in reasons


def test_a_phone_has_no_echoes_no_rest_position_and_no_velocity_chart(tmp_path: Path) -> None:
    """The report of an acceleration with knocks speaks of what an accelerometer measures."""
    t, rng = np.arange(2000) / 100, np.random.default_rng(5)
    y = 3.0 * np.exp(-0.02 * t) * np.cos(8.0 * t) + 0.02 * rng.standard_normal(t.size)
    y[rng.choice(t.size, 300, replace=False)] += 4.0 * rng.standard_normal(300)
    written = reported(table(tmp_path / "phone.csv", y, "Linear Acceleration z (m/s^2)"), tmp_path)
    page = (written / "report.html").read_text("utf-8")
    assert "m/s²" in page
    assert "<code>false_echoes</code>" in page  # the code never changes its meaning: samples that were left out
    words = re.sub(r"<style.*?</style>", "", page.partition('id="details"')[0], flags=re.DOTALL)
    for wrong in ("false echo", "rest position", "bob", "distance"):
        assert wrong not in words.lower(), wrong
    assert "figure-motion-0" not in page


def test_every_finding_is_shown_once(page: str, result: dict[str, Any]) -> None:
    """Each code stands on the page in one place, and a simulated run is called so."""
    assert sorted(re.findall(r"<code>([a-z_]+)</code>", page)) == sorted({x["code"] for x in result["findings"]})
    assert "simulated, not measured" in page


def test_hostile_text_is_escaped_everywhere(tmp_path: Path) -> None:
    """The names of a file and of a channel, a note and a mark that look like markup come out as text."""
    bad = "<script>alert('x')</script>"
    t = np.arange(600) / 100
    y = 0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.0 * t) + 1e-4 * np.random.default_rng(3).standard_normal(t.size)
    recording = table(tmp_path / "<b onload=x>50%_&.csv", y, heading=f"{bad} (m)")
    assert main(["scene", str(recording), "--note", bad, "--mark", f"2={bad}"]) == 0
    written = reported(recording, tmp_path)
    page = (written / "report.html").read_text("utf-8")
    assert len(re.findall("<script", page)) == 2  # the numbers and the script
    assert "<b onload" not in page
    assert page.count("&lt;script&gt;") >= 3
    assert "&lt;b onload=x&gt;50%_&amp;" in page
    in_tex = (written / "table.tex").read_text("utf-8").replace(r"\allowbreak{}", "")
    assert r"50\%\_\&" in in_tex


def test_a_run_without_oscillation_gives_a_report_too(folder: Path, tmp_path: Path) -> None:
    """Its report says why, and removes the files of an earlier report that it does not have."""
    recording = table(tmp_path / "still.csv", 0.3 + 1e-4 * np.random.default_rng(3).standard_normal(800))
    shutil.copytree(folder, tmp_path / "still.csv.results")
    left = files_in(reported(recording, tmp_path))
    assert not [name for name in left if name.startswith("figures/")]
    assert "motion.csv" not in left
    page = (tmp_path / "still.csv.results" / "report.html").read_text("utf-8")
    assert "<code>no_oscillation</code>" in page
    assert "simulated, not measured" not in page
