"""The report: what stands in its files, and what must never."""

from __future__ import annotations

import base64
import csv
import dataclasses
import functools
import hashlib
import html
import io
import itertools
import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.analyse import Analysis, Oscillation, Overdamped, Still, analyse
from pipeline.bench.scene import Scene
from pipeline.findings.finding import Finding
from pipeline.findings.registry import FINDINGS
from pipeline.numerics.estimate import Estimate
from pipeline.registry.quantities import INPUTS
from pipeline.results.classic import classic
from pipeline.results.compare import SpringRun, compare_springs
from pipeline.track import UNITS, UNUSABLE, Track
from springmass.page.web.security import REPORT_POLICY
from springmass.report.advice import LAW_CODES
from springmass.report.budgets import budget_csv, budget_text, budgets_of, correlations_of
from springmass.report.figures import comparison_figure, draw, motion_figure
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, table_tex
from springmass.report.laws import laws_of
from springmass.report.motion_table import motion_csv, smoothed_or_why
from springmass.report.recorded import Note
from springmass.report.script import report_script
from springmass.report.tables import law_status, pretty, pretty_number, results_csv, table_rows
from springmass.report.words import caption, equation, kept, verdict
from springmass.report.write import write_report
from springmass.runs.analysing import Analysed
from springmass.runs.comparing import Compared

PROVENANCE = {"version": "0.1.0", "parameters": {"cycles": {"false_alarm": 1e-6}}, "command": "analyse <run>"}
SCENE = Scene(
    bob_mass_kg=Estimate(0.2176, 5e-5, "kg"),
    spring_mass_kg=Estimate(0.01, 5e-4, "kg"),
    disc_diameter_m=Estimate(0.102, 5e-4, "m"),
    air_temperature_c=Estimate(20.0, 0.5, "degC"),
)


def track_of(
    seconds: float, *, noise_m: float = 1e-4, gamma: float = 0.0065, beta: float = 0.2, echoes: bool = True
) -> Track:
    """Return a damped oscillation at 100 Hz, with false echoes unless told otherwise, a few samples missing."""
    rng = np.random.default_rng(7)
    t = np.arange(round(100 * seconds)) / 100
    decay = np.exp(-gamma * t)
    amplitude = 0.05 * decay / (1 + beta * 0.05 * (1 - decay) / gamma)
    y = 0.22 + amplitude * np.cos(7.95 * t - 0.7) + noise_m * rng.standard_normal(t.size)
    if echoes:
        y[rng.integers(0, t.size, t.size // 200)] = 1.4
    y[60:66] = np.nan
    return Track.from_arrays(t, y, quantum_m=1e-5, kind="simulated")


@functools.cache
def damped() -> Analysis:
    """Return the analysis of a long damped run in a known scene."""
    return analyse(track_of(60.0), SCENE)


@functools.cache
def bare() -> Analysis:
    """Return the analysis of a short run in an unknown scene."""
    return analyse(track_of(8.0, gamma=0.003, beta=0.0))


@functools.cache
def clipped() -> Analysis:
    """Return the analysis of a run that left the sensor's range and that damping laws hardly distinguish."""
    track = track_of(20.0, gamma=0.003, beta=0.0)
    return analyse(dataclasses.replace(track, y=np.minimum(track.y, 0.25)))


@functools.cache
def still() -> Analysis:
    """Return the analysis of a run in which nothing oscillates."""
    rng = np.random.default_rng(3)
    t = np.arange(800) / 100
    return analyse(Track.from_arrays(t, 0.3 + 1e-4 * rng.standard_normal(800)))


def run_of(analysis: Analysis, name: str = "run", **given: Any) -> Analysed:
    """Return a run as a caller hands it over."""
    read = {"path": f"{name}.txt", "format": "csv", **given}
    return Analysed(name, analysis, {"input": read, "quality": analysis.quality, "provenance": PROVENANCE})


def written(directory: Path, *runs: Analysed, **options: Any) -> str:
    """Write a report and return its page."""
    page = write_report(directory, runs, **options)
    assert page == directory / "report.html"
    return page.read_text("utf-8")


def page_of(*runs: Analysed) -> str:
    """Return the page without its figures, which take most of the time."""
    return render_html(runs, [{} for _ in runs], provenance=PROVENANCE)


def files_in(directory: Path) -> dict[str, bytes]:
    """Return the content of every file below a directory."""
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def pictures_in(page: str) -> list[str]:
    """Return the pictures of a page, in base64."""
    return re.findall(r'<img src="data:image/svg\+xml;base64,([^"]*)"', page)


def test_every_file_of_a_report_is_written(tmp_path: Path) -> None:
    """A report is a page, six tables and every figure that the scene allows, as PDF if asked, and nothing besides."""
    written(tmp_path / "run.results", run_of(bare()), pdf=True)
    figures = {
        f"figures/{name}.{kind}"
        for name in ("position", "amplitude", "logarithmic", "frequency", "spectrum", "phase", "energy", "motion")
        for kind in ("svg", "pdf")
    }
    tables = {"report.html", "results.json", "results.csv", "table.tex", "budget.csv", "budget.tex", "motion.csv"}
    assert set(files_in(tmp_path / "run.results")) == tables | figures
    written(tmp_path / "disc.results", run_of(damped()))
    drawn = {name for name in figures | {"figures/drag.svg"} if name.endswith(".svg")}
    assert set(files_in(tmp_path / "disc.results")) == tables | drawn
    for name, content in files_in(tmp_path / "disc.results").items():
        if name.endswith(".svg"):
            assert ElementTree.fromstring(content).tag.endswith("svg")


def test_the_page_needs_nothing_from_outside(tmp_path: Path) -> None:
    """The page holds its one script, its style and its pictures, and refers to no other file and no network."""
    page = written(tmp_path, run_of(bare()))
    assert re.search(r"<script[^>]*src|<link|<iframe|@import", page) is None
    without_script = page.replace(report_script(), "")
    assert re.search(r"https?://", without_script) is None
    references = re.findall(r'(?:src|href|data)="([^"]*)"|url\(([^)]*)\)', without_script)
    assert {(a or b)[:5] for a, b in references if not (a or b).startswith("#")} <= {"data:"}


def test_the_policy_of_a_served_report_allows_its_script_and_no_other() -> None:
    """The digest in the policy is that of the text between the script's tags."""
    (script,) = re.findall(r"<script>(.*?)</script>", page_of(run_of(bare())), re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}';" in REPORT_POLICY
    assert "unsafe-inline'; img" in REPORT_POLICY  # of styles; the script's directive names the digest alone
    assert f"'{digest}" not in REPORT_POLICY.split("script-src")[0]


def test_the_numbers_of_the_charts_are_those_of_the_analysis() -> None:
    """Samples, fit, flags and amplitudes stand in the page as JSON; without a number there is null."""
    page = page_of(run_of(damped()))
    data = json.loads(
        re.findall(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)[0]
    )
    (run,), motion = data["runs"], damped().motion
    assert isinstance(motion, Oscillation)
    assert run["t"] == {"start": 0.0, "step": pytest.approx(0.01), "count": len(damped().track)}
    y = np.array(run["data"]["y"], np.float64)
    np.testing.assert_allclose(y, 1e3 * damped().track.y, rtol=1e-4)
    flagged = {row for row, _ in run["data"]["flagged"]}
    assert flagged == set(np.flatnonzero(((damped().flags & UNUSABLE) != 0) | ~np.isfinite(damped().track.y)).tolist())
    assert any("false echo" in why for _, why in run["data"]["flagged"])
    np.testing.assert_allclose(run["data"]["amplitude"]["y"], 1e3 * motion.demodulated.amplitude, rtol=1e-4)
    assert run["data"]["amplitude"]["laws"][0]["name"] == motion.damping.selected
    assert data["table"]["latex"] == table_tex(["run"], [damped()])
    period = damped().estimates["period"]
    assert f"period\tT\ts\t{period.value!r}\t{period.u!r}" in data["table"]["cells"]


def test_no_two_elements_share_an_id_and_every_reference_is_met(tmp_path: Path) -> None:
    """The sections and figures of several runs keep their names apart."""
    page = written(tmp_path, run_of(damped(), "one"), run_of(bare(), "two"))
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids)) > 8
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', page)) <= set(ids)


def test_hostile_text_is_escaped_everywhere() -> None:
    """A name, a title, a finding and a command that look like markup come out as text."""
    bad = "<script>alert('x')</script>"
    analysis = dataclasses.replace(damped(), findings=(Finding("clipped", "warning", bad),))
    page = page_of(run_of(analysis, bad, title=bad))
    assert len(re.findall("<script", page)) == 2  # the numbers and the script
    assert "<script>alert" not in page
    assert page.count("&lt;script&gt;") >= 4
    assert "analyse &lt;run&gt;" in page


@pytest.mark.parametrize("make", [damped, bare, still])
def test_every_finding_is_shown_once(make: Any) -> None:
    """Each code stands on the page in one place; errors come before warnings."""
    page = page_of(run_of(make()))
    codes = re.findall(r"<code>([a-z_]+)</code>", page)
    assert sorted(codes) == sorted({finding.code for finding in make().findings})
    top = page[page.index('id="warnings"') : page.index('id="details"')]
    order = re.findall(r'<li class="(\w+)">', top)
    assert order == sorted(order, key=["error", "warning"].index)


def test_every_warning_says_what_to_do_and_what_to_write() -> None:
    """The most harmful comes first, each with advice, a sentence for the lab report and a link to its figure."""
    many = [Finding(code, "warning", f"{code} has gamma = 2.0e-03 +- 1.0e-04 1/s") for code in ("quantised", "clipped")]
    many += [Finding("rest_drift", "warning", "It drifts"), Finding("stale_header", "warning", "The header is old")]
    run = run_of(dataclasses.replace(damped(), findings=tuple(many)))
    page = html.unescape(render_html([run], [{"position": b"<svg/>"}], provenance=PROVENANCE))
    top = page[page.index('id="warnings"') : page.index('id="details"')]
    assert re.findall(r"<code>(\w+)</code>", top) == ["stale_header", "clipped", "quantised", "rest_drift"]
    assert all(x.advice in top for x in many)
    assert "γ = 2.0 × 10⁻³ ± 1.0 × 10⁻⁴ s⁻¹" in top
    assert "“It drifts. The stated uncertainties include this.”" in top
    assert top.count('<a href="#figure-position-0">') == 3


def test_every_warning_of_the_reference_has_a_remedy() -> None:
    """What the page of findings calls a warning or an error has its sentence on what to do."""
    reference = (Path(__file__).parents[4] / "docs/reference/findings.md").read_text("utf-8")
    codes = re.findall(r"^\| `(\w+)` \| ([^|]*)\|", reference, re.MULTILINE)
    grave = {code for code, severity in codes if "warning" in severity or "error" in severity}
    assert len(grave) > 30
    assert {code for code in grave if not FINDINGS[code].advice} - LAW_CODES == set()


def test_the_page_has_landmarks_and_headings_in_order() -> None:
    """One banner, one main part, no level of headings is left out, and every link is met."""
    page = page_of(run_of(damped(), "one"), run_of(still(), "two"))
    assert [page.count(f"<{name}") for name in ("header", "main", "h1")] == [1, 1, 1]
    levels = [int(level) for level in re.findall(r"<h(\d)", page)]
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    linked = re.findall(r'<a href="#([^"]+)"', page)
    assert set(linked) <= set(re.findall(r'\bid="([^"]+)"', page))


def test_the_head_says_when_and_at_which_bench() -> None:
    """Date, samples and conditions stand above everything; marks, events and the calibration are listed."""
    recorded = {
        "start_time": "2026-11-22T22:30:35.97+00:00",
        "marks": [{"t_s": 6.2, "text": "fan on", "channel": 0}],
        "events": [{"t_s": 0.5, "kind": "trigger", "facts": {"threshold_m": 0.01, "keep_s": 2.0}}],
        "sensor": {"calibration": {"offset_m": 0.012, "u_offset_m": 0.0005, "scale": 1.0, "u_scale": 0.0}},
    }
    page = page_of(dataclasses.replace(run_of(damped()), recorded=recorded))
    head = page[page.index("<header") : page.index("</header")]
    assert "Recorded 2026-11-22 22:30:35 UTC." in head
    assert "bob 0.217600 ± 0.000050 kg" in head
    listed = page[page.index('id="samples-0"') :]
    assert all(words in listed for words in ("fan on", "threshold m 0.01", "0.01200 ± 0.00050 m"))
    assert "Date of the recording not known" in page_of(run_of(damped()))


def test_rejected_laws_are_named_in_words() -> None:
    """Four sentences give the result; the table has every law, with the evidence for and against."""
    sentences = verdict(damped())
    assert len(sentences) == 4
    assert "linear and quadratic drag together" in sentences[1]
    page = page_of(run_of(damped()))
    table = page[page.index('<table class="laws"') :].split("</table>")[0]
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    assert table.count("<tbody") == len(motion.damping.fits)
    assert re.findall(r'<th scope="col">([^<]*)</th>', table) == ["law", "reduced χ²", "Δχ²", "dof", "ΔBIC"]
    assert re.search(r'linear<br><span class="sub">rejected', table)


def test_a_fit_that_does_not_describe_the_run_is_not_praised() -> None:
    """The sentence on residuals that are noise is missing where a finding says that they are not."""
    misfit = Finding("model_misfit", "warning", "The residuals are not noise.")
    fine, wrong = damped(), dataclasses.replace(damped(), findings=(misfit,))
    assert set(verdict(fine)) - set(verdict(wrong)) == {verdict(fine)[2]}


def test_the_page_has_a_paragraph_for_a_lab_report() -> None:
    """It names the program, the mass that oscillates and the expanded uncertainties; a bob at rest has none."""
    analysis = damped()
    assert isinstance(analysis.motion, Oscillation)
    mass = analysis.motion.derived.effective_mass_kg
    assert mass is not None
    page = page_of(run_of(analysis))
    (paragraph,) = re.findall(r'id="method-0".*?<p>(.*?)</p>', page, re.DOTALL)
    assert all(words in paragraph for words in ("springmass 0", kept(mass), "U(T)", "U(k)"))
    assert 'id="method-0"' not in page_of(run_of(still()))


@pytest.mark.parametrize(("quantity", "unit"), UNITS.items())
def test_the_verdict_speaks_of_what_was_recorded(quantity: str, unit: str) -> None:
    """A bob swings where its distance was taken; of anything else nobody knows of one, and no caption names a plot."""
    t = np.arange(1500) / 50.0
    y = 2.0 + 0.05 * np.exp(-0.02 * t) * np.cos(6.0 * t) + 3e-4 * np.random.default_rng(3).standard_normal(t.size)
    analysis = analyse(Track.from_arrays(t, y, quantity=quantity, unit=unit))
    word = {"length": "bob swings", "number": "value oscillates"}.get(quantity, f"{quantity} oscillates")
    assert verdict(analysis)[0].startswith(f"The {word.replace('_', ' ')} with the period T")
    names = draw(analysis) if quantity in ("velocity", "number") else ("position", "amplitude", "phase", "motion")
    for name in names:
        assert ("bob" in caption(name, analysis)) <= (quantity == "length")


@pytest.mark.parametrize("make", [bare, damped])
def test_what_holds_states_the_numbers_of_table_1(make: Callable[[], Analysis]) -> None:
    """A coefficient has one value and one uncertainty: the sentence, the finding and Table 1 agree."""
    analysis = make()
    assert isinstance(analysis.motion, Oscillation)
    derived = analysis.motion.derived
    stated = derived.coefficients
    assert kept(derived.estimates["damping_rate"]) in verdict(analysis)[1]
    rows = {row.name: row for row in table_rows([analysis])}
    assert rows["damping_rate"].estimates == (derived.estimates["damping_rate"],)
    if derived.leading is not None:
        (leading,) = rows[f"{derived.leading.law}.damping_rate"].estimates
        assert leading == derived.leading.estimates["damping_rate"]
        assert kept(leading) in verdict(analysis)[1]
    named = derived.coefficients_of(analysis.motion.damping.selected)
    assert all(equation(name, x).replace(" ", "\u00a0") in verdict(analysis)[1] for name, x in named.items())
    for row in laws_of(analysis.motion)["rows"]:
        if row["name"] == analysis.motion.damping.selected:
            assert {equation(name, x) for name, x in named.items()} <= set(row["coefficients"])
    for finding in analysis.findings:
        if finding.code == "mixed_drag":
            assert finding.values["beta"] == stated["beta"].value
            assert f"beta = {stated['beta']}" in finding.details


def test_simulated_data_cannot_pass_for_measured() -> None:
    """A simulated run says so at its head, a replayed one does not."""
    assert "simulated, not measured" in page_of(run_of(bare()))
    assert "simulated, not measured" not in page_of(run_of(still()))


def test_the_page_of_a_long_record_stays_small(tmp_path: Path) -> None:
    """Of twelve thousand samples no figure takes more than 300 kB of the page, and the page at most 1.5 MB."""
    track = track_of(120.0)
    run = dataclasses.replace(run_of(analyse(track, SCENE)), classic=classic(track, SCENE))
    page = written(tmp_path, run)
    drawn = pictures_in(page)
    assert len(drawn) == 10
    assert max(map(len, drawn)) < 300_000
    assert len(page.encode()) <= 1_500_000


def test_the_page_holds_the_files_of_its_figures(tmp_path: Path) -> None:
    """Every picture of the page is one of the files beside it, and every file is on the page."""
    page = written(tmp_path, run_of(damped()))
    files = {content for name, content in files_in(tmp_path).items() if name.startswith("figures/")}
    assert {base64.b64decode(data) for data in pictures_in(page)} == files


@pytest.mark.parametrize("make", [damped, bare, still, clipped])
def test_nothing_of_a_figure_is_cut_off_or_covered(make: Callable[[], Analysis]) -> None:
    """Everything lies within its figure, labels of axes do not meet, and legends above a panel cover none."""
    analysis = make()
    method = classic(analysis.track, analysis.scene) if analysis.track.t[-1] > 15.0 else None
    notes = [Note(6.2, "fan on", "mark"), Note(0.5, "threshold m 0.01", "trigger"), Note(3.0, "", "lost")]
    for name, figure in draw(analysis, notes=notes, classic=method).items():
        figure.draw_without_rendering()
        paper = figure.bbox.padded(0.5)
        labels = [
            label.get_window_extent()
            for panel in figure.axes
            for label in (panel.xaxis.label, panel.yaxis.label, panel.title)
            if label.get_text()
        ]
        assert not any(one.overlaps(other) for one, other in itertools.combinations(labels, 2)), name
        for panel in figure.axes:
            box = panel.get_tightbbox()
            assert box is not None
            assert (paper.x0 <= box.x0, paper.y0 <= box.y0, box.x1 <= paper.x1, box.y1 <= paper.y1) == (True,) * 4, name
            legend = panel.get_legend()
            if legend is not None and name != "drag":  # whose curve leaves the lower left free
                assert not any(legend.get_window_extent().overlaps(other.bbox) for other in figure.axes), name


def test_marks_and_the_trigger_are_drawn() -> None:
    """Each stands in the figure of the position at its time, a mark with its words."""
    notes = [Note(6.2, "fan $on$", "mark"), Note(0.5, "threshold m 0.01", "trigger"), Note(9.0, "", "ended")]
    panel = draw(damped(), notes=notes)["position"].axes[0]
    lines = {str(line.get_label()): line.get_xdata()[0] for line in panel.lines if len(set(line.get_xdata())) == 1}
    assert lines == {"mark": 6.2, "trigger": 0.5}
    assert [text.get_text() for text in panel.texts] == [r"fan \$on\$"]


def test_the_classic_method_is_drawn_over_this_analysis() -> None:
    """Its two maxima are seven of its periods apart, and its exponential and windows lie over the amplitudes."""
    found = classic(track_of(60.0), SCENE)
    above, below = draw(damped(), classic=found)["classic"].axes
    (picked,) = [line for line in above.lines if "picked" in str(line.get_label())]
    assert np.ptp(picked.get_xdata()) == pytest.approx(7 * found.estimates["period"].value)
    curves = {str(line.get_label()): np.asarray(line.get_ydata()) for line in below.lines}
    assert curves["its exponential"][0] == pytest.approx(1e3 * found.window_amplitude[0])
    assert {"half the range in 1.5 s", "linear+quadratic (selected)"} <= set(curves)


def test_energy_is_split_into_its_parts() -> None:
    """Kinetic and potential energy are each half of the whole in the mean of a period, and add up to it."""
    above, _, parts = draw(damped())["energy"].axes
    kinetic, potential = (np.asarray(line.get_ydata()) for line in above.lines if "mean" in str(line.get_label()))
    law = next(line for line in above.lines if "law" in str(line.get_label()))
    expected = np.interp(above.lines[0].get_xdata(), law.get_xdata(), law.get_ydata())
    # Their markers take turns along the time.
    count = min(kinetic.size, potential.size)
    kinetic, potential = kinetic[:count], potential[:count]
    np.testing.assert_allclose(kinetic / potential, 1.0, atol=0.05)
    assert np.median(kinetic + potential) == pytest.approx(np.median(expected), rel=0.02)
    swings = [np.asarray(line.get_ydata()) for line in parts.lines]
    np.testing.assert_allclose(swings[0] + swings[1], swings[2])
    assert np.ptp(swings[2]) < 0.3 * np.ptp(swings[0])


def test_the_legend_names_the_laws_that_matter() -> None:
    """The selected law, the exponential and the admissible laws have names, the others together one grey entry."""
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    labels = draw(damped())["amplitude"].axes[0].get_legend_handles_labels()[1]
    assert "linear+quadratic (selected)" in labels
    assert "exponential, linear drag (rejected)" in labels
    assert f"{len(motion.damping.fits) - 2} other laws" in labels


def test_the_motion_is_written_at_every_sample() -> None:
    """Position, velocity and acceleration stand beside each distance; what is no number is an empty cell."""
    analysis = damped()
    smoothed = analysis.smoothed()
    rows = list(csv.DictReader(io.StringIO(motion_csv(analysis, smoothed))))
    assert len(rows) == len(analysis.track)
    assert sum(row["used"] == "1" for row in rows) == analysis.quality["used"]
    assert rows[62]["distance_m"] == ""
    assert [float(row["time_s"]) for row in rows] == list(analysis.track.t)
    for column, value in (
        ("u_velocity_m_per_s", smoothed.u_velocity),
        ("acceleration_m_per_s2", smoothed.acceleration),
    ):
        assert np.allclose([float(row[column]) for row in rows], value, rtol=1e-9, atol=0.0)


def test_the_band_of_the_velocity_is_wider_at_the_edges() -> None:
    """The figure's lowest panel shows the uncertainty grow towards both ends of the record."""
    u = motion_figure(bare()).axes[3].lines[0].get_ydata()
    middle = float(np.median(np.asarray(u)))
    assert float(u[0]) > 1.3 * middle
    assert float(u[-1]) > 1.3 * middle


def test_the_law_of_the_figure_is_the_motion_itself() -> None:
    """On a record that follows its law the difference drawn stays within three of its uncertainties."""
    difference = np.asarray(motion_figure(damped()).axes[3].lines[0].get_ydata())
    assert 0.0 < np.max(np.abs(difference)) < 3e3 * np.max(damped().smoothed().u_velocity)


def test_a_record_that_cannot_be_smoothed_says_so(tmp_path: Path) -> None:
    """Its page has a sentence in the figure's place, and a table of an earlier report is taken away."""
    motion = bare().motion
    assert isinstance(motion, Oscillation)
    flags = np.full_like(motion.demodulated.flags, int(UNUSABLE))
    blind = dataclasses.replace(
        bare(), motion=dataclasses.replace(motion, demodulated=dataclasses.replace(motion.demodulated, flags=flags))
    )
    why = smoothed_or_why(blind)
    assert isinstance(why, str)
    assert "eight usable samples" in why
    assert "motion" not in draw(bare(), why)
    assert "Velocity and acceleration were not estimated" in page_of(run_of(blind))
    written(tmp_path, run_of(bare()))
    assert (tmp_path / "motion.csv").exists()
    written(tmp_path, run_of(still()))
    assert not (tmp_path / "motion.csv").exists()


def test_csv_holds_every_estimate_and_every_law() -> None:
    """The CSV gives back each number to its last digit."""
    rows = list(csv.DictReader(io.StringIO(results_csv(["a, b"], [damped()]))))
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    expected = dict(damped().estimates)
    for law, fit in motion.damping.fits.items():
        expected |= {f"{law}.{name}": x for name, x in motion.derived.parameters_of(fit).items()}
    read = {row["name"]: Estimate(float(row["value"]), float(row["u"]), row["unit"]) for row in rows}
    assert read == {name: Estimate(x.value, x.u, x.unit) for name, x in expected.items()}
    assert {row["run"] for row in rows} == {"a, b"}


def test_tex_is_balanced_and_states_uncertainties_in_parentheses() -> None:
    """The LaTeX table closes what it opens, escapes names and writes value(u) with the unit's macro."""
    tex = table_tex(["50%_run#1", "b"], [damped(), bare()])
    plain = re.sub(r"\\[\\{}%_#&$]", "", tex)
    assert plain.count("{") == plain.count("}")
    assert plain.count("$") % 2 == 0
    assert r"50\%\_run\#1" in tex
    assert re.search(r"Period & \$T\$ & \\qty\{0\.\d+\(\d\d\)\}\{\\second\} & ", tex)
    assert {line.count(" & ") for line in tex.splitlines() if line.endswith(r"\\")} == {3}


def test_budget_tables_hold_every_input() -> None:
    """The CSV gives back every contribution; the page and the LaTeX table those of a thousandth and more."""
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    budgets = motion.derived.budgets
    rows = list(csv.DictReader(io.StringIO(budget_csv(["a"], [damped()]))))
    assert [(row["quantity"], row["input"]) for row in rows] == [
        (name, c.name) for name, budget in budgets.items() for c in budget.contributions
    ]
    for row in rows:
        found = next(c for c in budgets[row["quantity"]].contributions if c.name == row["input"])
        assert (float(row["contribution"]), float(row["share"]), row["type"]) == (found.u, found.share, found.kind)
    page, tex = html.unescape(page_of(run_of(damped()))), budget_tex(["50%"], [damped()])
    for row in budgets_of(damped()):
        assert row.rest + sum(c.share for c in row.contributions) == pytest.approx(1.0)
        assert all(INPUTS[c.name].label in page and INPUTS[c.name].label in tex for c in row.contributions)
    plain = re.sub(r"\\[\\{}%_#&$]", "", tex)
    assert plain.count("{") == plain.count("}")
    lines = [line for line in tex.splitlines() if line.endswith(r"\\") and r"\caption" not in line]
    assert {line.count(" & ") for line in lines} == {0, 3}
    # At 8 pt a letter is 3.9 pt wide on average, and an article's lines on A4 are 345 pt.
    for line in lines:
        printed = re.sub(
            r"\\multicolumn\{4\}\{l\}|\\(qty|num|text)|\\times|[{}$]|\\\\$", "", re.sub(r"\\(per|nu|infty)", "1", line)
        )
        printed = re.sub(r"\\(\w{1,3})\w*", r"\1", printed)
        cells = [cell.strip() for cell in printed.split(" & ")]
        assert len(cells[0]) <= 88 if len(cells) == 1 else 18 + 3.9 * sum(map(len, cells[1:])) <= 0.58 * 345 - 36
    assert budget_csv(["b"], [still()]).count("\n") == 1
    assert budgets_of(still()) == ()


def test_expanded_uncertainties_and_correlations_stand_on_the_page() -> None:
    """Each result has its U with coverage factor and degrees of freedom, and the main ones their correlations."""
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    section = page_of(run_of(damped())).split('id="budgets-0"')[1].split("</details>")[0]
    budget = motion.derived.budgets["gamma"]
    row = re.search(r">linear damping</th>((?:<td[^>]*>[^<]*</td>)+)", section)
    assert row is not None
    cells = re.findall(r">([^<]*)</td>", row[1])
    assert cells[0] == f"{budget.dof:.0f}"
    assert float(cells[1]) == pytest.approx(budget.coverage_factor, abs=0.005)
    assert cells[2] == f"{pretty_number(budget.expanded)} s⁻¹"
    names, matrix = correlations_of(damped())
    joint = motion.derived.joint
    assert matrix[names.index("gamma")][names.index("beta")] == pytest.approx(
        joint.correlation[joint.names.index("gamma"), joint.names.index("beta")]
    )
    assert f"{matrix[names.index('gamma')][names.index('beta')]:.2f}".replace("-", "−") in section
    assert correlations_of(still()) == ((), [])


def test_budget_in_brief_names_the_greatest_inputs() -> None:
    """A line a quantity that has several inputs, in ASCII and within the terminal; nothing where nothing moves."""
    text = budget_text(damped())
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 105
    line = next(line for line in text.splitlines() if "spring constant" in line)
    assert line.split("spring constant")[1].lstrip().startswith("mass of the spring (B) ")
    assert "noise" not in text
    assert budget_text(still()) == ""


@pytest.mark.parametrize(
    ("estimate", "tex"),
    [
        (Estimate(0.752857, 0.001429, "s"), r"\qty{0.7529(14)}{\second}"),
        (Estimate(13.94, 1.23, ""), r"\num{13.9(12)}"),
        (Estimate(1103.0, 148.0, ""), r"\num{1100(150)}"),
        (Estimate(-8.36e-5, 9.6e-7, "m"), r"\qty{-8.360(96)e-5}{\metre}"),
        (Estimate(14.0, 0.0, "N/m"), r"\qty{14}{\newton\per\metre}"),
        (Estimate(float("nan"), 1.0, "m"), "--"),
    ],
)
def test_tex_and_page_show_the_digits_that_u_allows(estimate: Estimate, tex: str) -> None:
    """Value and uncertainty end at the same digit, small numbers as powers of ten, exact ones without u."""
    analysis = dataclasses.replace(still(), estimates={"period": estimate})
    assert tex in table_tex(["run"], [analysis])


def test_page_numbers_are_typeset() -> None:
    """A minus is a minus, a power of ten stands raised, what is no number is a dash."""
    assert pretty(Estimate(-8.36e-5, 9.6e-7, "1/(m s)")) == "(−8.360 ± 0.096) × 10⁻⁵ m⁻¹ s⁻¹"
    assert pretty(None) == pretty_number(None) == pretty_number(float("nan")) == "–"
    assert pretty_number(-0.00077) == "−0.00077"


def test_json_is_strict(tmp_path: Path) -> None:
    """What is no number becomes null, numpy's numbers plain ones; one run gives an object, several a list."""
    run, odd = (
        run_of(still()),
        {"a": float("nan"), "b": [np.float64("inf"), np.int64(3), np.bool_(True)], "c": Path("x"), "d": None},
    )
    written(tmp_path / "one", dataclasses.replace(run, result={**run.result, **odd}))

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    text = (tmp_path / "one/results.json").read_text("utf-8")
    found = json.loads(text, parse_constant=refuse)
    assert {key: found[key] for key in odd} == {"a": None, "b": [None, 3, True], "c": "x", "d": None}
    written(tmp_path / "two", run_of(still(), "a"), run_of(still(), "b"))
    assert len(json.loads((tmp_path / "two/results.json").read_text("utf-8"))) == 2


def test_a_run_without_oscillation_gives_a_report_too(tmp_path: Path) -> None:
    """Its report has the position alone, says why, and takes away figures that an earlier one left."""
    assert isinstance(still().motion, Still)
    written(tmp_path, run_of(bare()))
    page = written(tmp_path, run_of(still()))
    assert {name for name in files_in(tmp_path) if "figures" in name} == {"figures/position.svg"}
    assert 'class="error"' in page
    assert "Phase plot" not in page


@pytest.mark.parametrize(
    "shape",
    [
        lambda t: 0.06 * np.exp(-0.8 * t) - 0.01 * np.exp(-6.0 * t),
        lambda t: 0.05 * (1.0 + 3.0 * t) * np.exp(-3.0 * t),
        lambda t: 0.05 * np.exp(-t) * np.cos(8.0 * t),
    ],
    ids=["overdamped", "critical", "strong"],
)
def test_a_relaxation_is_drawn_with_its_fit(shape: Any) -> None:
    """The curve over the samples of a motion that damping ends is that motion."""
    t = np.arange(1000) / 100
    rng = np.random.default_rng(2)
    analysis = analyse(Track.from_arrays(t, 0.3 + shape(t) + 3e-4 * rng.standard_normal(t.size)))
    assert isinstance(analysis.motion, Overdamped)
    (fit,) = [line for line in draw(analysis)["position"].axes[0].lines if line.get_label() == "fit"]
    x, y = np.asarray(fit.get_xdata()), np.asarray(fit.get_ydata())
    assert np.max(np.abs(y - 1e3 * (0.3 + shape(x)))) < 0.3
    assert "nothing oscillates" not in caption("position", analysis)


def test_a_rest_position_that_moves_is_drawn_by_itself() -> None:
    """A step of 0.8 mm, which the whole position hides, stands in a panel with its windows; a constant has none."""
    t = np.arange(2000) / 100
    noise_m = 1e-4 * np.random.default_rng(2).standard_normal(t.size)
    steady_m = 0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.3 * t) + noise_m
    steady, stepping = (analyse(Track.from_arrays(t, y)) for y in (steady_m, steady_m + 8e-4 * (t > 8.2)))
    assert len(draw(steady)["position"].axes) == 4
    assert "rest position" not in caption("position", steady)
    panel = draw(stepping)["position"].axes[4]
    windows, curve = panel.lines
    x, y = np.asarray(windows.get_xdata()), np.asarray(windows.get_ydata())
    assert float(np.mean(y[x > 8.2]) - np.mean(y[x < 8.2])) == pytest.approx(0.8, abs=0.02)
    assert np.max(np.abs(y - np.interp(x, curve.get_xdata(), curve.get_ydata()))) < 0.1
    assert panel.get_ylabel() == "rest / mm"
    assert "the rest position of each window" in caption("position", stepping)


@pytest.mark.parametrize("seconds", [1.6, 3.0])
def test_a_very_short_record_can_be_drawn(tmp_path: Path, seconds: float) -> None:
    """Two and four periods give every figure."""
    analysis = analyse(track_of(seconds, noise_m=2e-3), SCENE)
    assert "Energy" in written(tmp_path, run_of(analysis))


def test_several_runs_stand_side_by_side(tmp_path: Path) -> None:
    """Table 1 has a column a run, each run its section and its own figures, the comparison its sentence."""
    runs = [run_of(damped(), "same"), run_of(damped(), "same")]
    mass = Estimate(0.2176, 5e-5, "kg")
    springs = [SpringRun(run.name, run.analysis.estimates["angular_frequency"], mass) for run in runs]
    comparison = compare_springs(springs)
    page = written(tmp_path, *runs, compared=Compared(comparison, (), ()))
    assert page.count('<th scope="col">same</th>') == 2
    assert len(re.findall(r"<h4[^>]*>Phase plot</h4>", page)) == 2
    assert html.escape(comparison.message.replace("+-", "±")) in page
    assert len([name for name in files_in(tmp_path) if name.endswith(".svg")]) == 20


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_a_comparison_is_drawn_with_every_run(factor: float) -> None:
    """Every run has its bar and its pull; a mean is drawn where the runs agree, and only there."""
    mass, omega = Estimate(0.2, 5e-5, "kg"), Estimate(8.0, 1e-4, "rad/s")
    long = "a_run_with_a_name_that_no_column_holds_in_capitals_WMWMWMWM"
    springs = [SpringRun("a", omega, mass), SpringRun(long, Estimate(8.0 * factor, 1e-4, "rad/s"), mass)]
    found = compare_springs(springs)
    figure = comparison_figure(found)
    figure.draw_without_rendering()
    left, right = figure.axes
    assert left.get_yticklabels()[0].get_text() == "a"
    assert all(label.get_window_extent().x0 > 0 for label in left.get_yticklabels())
    labels = left.get_legend_handles_labels()[1]
    assert ("mean ± u" in labels) == found.agree == (factor == 1.0)
    drawn = right.collections[-1].get_offsets()
    np.testing.assert_allclose(np.asarray(drawn)[:, 0], found.pulls)


def test_the_classic_method_is_set_beside_with_its_biases() -> None:
    """Its numbers stand next to this analysis's own, each with what is wrong with it."""
    run = dataclasses.replace(run_of(bare()), classic=classic(track_of(8.0, echoes=False)))
    page = page_of(run)
    assert "two sampled maxima decide" in page
    assert "false echoes enter" in page


def test_a_law_that_fails_is_never_called_selected_alone() -> None:
    """Where every law is rejected the least bad one is called so."""
    motion = damped().motion
    assert isinstance(motion, Oscillation)
    name = motion.damping.selected
    assert law_status(motion.damping, name) == "selected"
    fits = {law: dataclasses.replace(fit, rejection="misfit") for law, fit in motion.damping.fits.items()}
    assert law_status(dataclasses.replace(motion.damping, fits=fits), name).startswith("rejected")


def test_a_report_needs_a_run(tmp_path: Path) -> None:
    """Nothing to report is refused before anything is written."""
    with pytest.raises(ValueError, match="one run at least"):
        write_report(tmp_path / "x", [])
    assert not (tmp_path / "x").exists()
