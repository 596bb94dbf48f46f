"""One file gives one set of numbers: on the command line, in Python, in a report, in a course and on the page."""

import contextlib
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import springmass as sm
from springmass.cli import main
from springmass.errors import OK, UNREADABLE
from springmass.page.feeds import view_of
from springmass.page.live_analysis import Watcher
from tests.courses import rows_of
from tests.sampling import sampled

RECORDINGS = Path(__file__).resolve().parents[2].parent / "shared" / "recordings"
WILD = {
    "one of several runs, without a rate": (
        "Mattia04__Smorzamento/Oscillazioni pretensionata_cd_5e7masse.csv",
        {"run": "Run #2", "rate_hz": 20.0},
    ),
    "one of several channels, with its unit": (
        "wild/coupled__maxi2321__trayectorias.csv",
        {"channel": "y_rojo", "unit": "cm"},
    ),
    "one of several rates": ("ubsuny__data-analysis-final20/Raw Data.csv", {"channel": "Gyroscope y"}),
    "three columns of a spreadsheet": ("EroSkulled__PHY224-324/Data2.csv", {"channel": "y", "unit": "cm"}),
    "a pair of files": (
        "kamjha__PHY224/position_osc.txt",
        {"velocity": str(RECORDINGS / "kamjha__PHY224/velocity_osc.txt")},
    ),
    "a long recording of a disc": (
        "filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv",
        {"channel": "position", "unit": "m"},
    ),
}
Numbers = dict[str, tuple[float, float | None]]


def run(*arguments: str | Path) -> str:
    """Run a command line that gives a result, if only that nothing oscillates; return what it printed."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()) as err:
        assert main([str(argument) for argument in arguments]) in (OK, UNREADABLE), err.getvalue()
    return out.getvalue()


def options_of(answers: Mapping[str, Any]) -> list[str]:
    """Return keyword arguments of :func:`springmass.load` as options."""
    return [f"--{name.replace('_', '-')}={value}" for name, value in answers.items()]


def numbers_of(estimates: Mapping[str, Mapping[str, Any]]) -> Numbers:
    """Return values and uncertainties of a JSON's estimates."""
    return {name: (each["value"], each["u"]) for name, each in estimates.items()}


def compare_all(path: Path, answers: Mapping[str, Any], folder: Path, accuracy: str) -> Numbers:
    """Analyse a file in every way, assert that the numbers and the findings are the same, and return the numbers."""
    options = ["--accuracy", accuracy, *options_of(answers)]
    (line,) = run("analyse", path, "--json", *options).splitlines()
    result = json.loads(line)
    numbers, codes = numbers_of(result["estimates"]), [finding["code"] for finding in result["findings"]]
    assert numbers

    analysed = sm.analyse(path, accuracy=accuracy, **answers)
    found = {name: (x.value, x.u if math.isfinite(x.u) else None) for name, x in analysed.analysis.estimates.items()}
    assert found == numbers
    assert [finding.code for finding in analysed.findings] == codes

    run("analyse", path, "-o", folder, *options)
    (written,) = folder.glob("*.results/results.json")
    reported = json.loads(written.read_text(encoding="utf-8"))
    of_report = reported[0] if isinstance(reported, list) else reported
    assert numbers_of(of_report["estimates"]) == numbers
    assert [finding["code"] for finding in of_report["findings"]] == codes

    if "velocity" not in answers:
        given = ["--accuracy", accuracy, *(f"--read={name}={value}" for name, value in answers.items())]
        run("batch", path, "-o", folder / "course", "--jobs", "1", "--reports", "0", *given)
        (row,) = rows_of(folder / "course" / "results.csv")
        assert row["input_sha256"] == result["input"]["sha256"]
        assert json.loads(row["findings"]) == codes
        shared = [name for name in numbers if row.get(name)]
        assert {"noise", "offset"} <= set(shared)
        assert {name: float(row[name]) for name in shared} == {name: numbers[name][0] for name in shared}
        assert {name: float(row[f"{name}_u"]) for name in shared if row.get(f"{name}_u")} == {
            name: numbers[name][1] for name in shared if row.get(f"{name}_u")
        }

    if accuracy == "standard":  # a complete run on the page
        loaded = sm.load(path, **answers).loaded
        watcher = Watcher(view_of(loaded), None)
        try:
            message = json.loads(watcher.region(-math.inf, math.inf))
        finally:
            watcher.close()
        shown = numbers_of(message["estimates"])
        both = shown.keys() & numbers.keys()
        assert len(both) >= 2
        assert {name: shown[name] for name in both} == {name: numbers[name] for name in both}
        grave = [finding["code"] for finding in result["findings"] if finding["severity"] != "info"]
        assert [finding["code"] for finding in message["findings"]] == grave
        if analysed.law is not None:
            assert "period" in both
    return numbers


@pytest.mark.parametrize(("name", "accuracy"), [("undamped", "fast"), ("damped", "standard")])
def test_a_bundled_recording_has_the_same_numbers_everywhere(tmp_path: Path, name: str, accuracy: str) -> None:
    """A file of MotionSensor.vi, alone."""
    numbers = compare_all(sm.sample_data() / f"{name}_simulated_position.txt", {}, tmp_path, accuracy)
    assert "period" in numbers


def test_a_pair_has_the_same_numbers_everywhere(tmp_path: Path) -> None:
    """A position file and its velocity file."""
    data = sm.sample_data()
    pair = {"velocity": str(data / "damped_simulated_velocity.txt")}
    compare_all(data / "damped_simulated_position.txt", pair, tmp_path, "standard")


def test_a_run_file_with_its_scene_has_the_same_numbers_everywhere(tmp_path: Path) -> None:
    """What a run file states about its sensor and its bench reaches the page too."""
    data = sm.sample_data()
    path = tmp_path / "damped.h5"
    scene = ("--scene", data / "damped.scene.toml")
    run("convert", data / "damped_simulated_position.txt", path, *scene)
    numbers = compare_all(path, {}, tmp_path, "standard")
    assert "drag_coefficient" in numbers


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/recordings")
@pytest.mark.parametrize("name", sampled(WILD))
def test_a_real_recording_has_the_same_numbers_everywhere(tmp_path: Path, name: str) -> None:
    """With the answers to the questions of its reader, given as options and as arguments."""
    path, answers = WILD[name]
    compare_all(RECORDINGS / path, answers, tmp_path, "standard")
