"""``springmass analyse``: the JSON as promised, one line per input, and exit codes that tell what happened."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from pipeline.accuracy import params_for
from pipeline.findings.finding import Finding
from pipeline.results.classic import classic

Cli = Callable[..., Any]

CODES = {
    "clipped",
    "false_echoes",
    "missing_samples",
    "duplicate_time",
    "non_monotonic_time",
    "at_rest",
    "handled",
    "restarted",
    "touched",
    "phase_jump",
    "nominal_clock",
    "rate_assumed",
    "rate_given",
    "unit_assumed",
    "unit_given",
    "stated_error_is_not_noise",
    "law_rejected",
    "laws_not_separable",
    "mixed_drag",
    "model_misfit",
    "amplitude_dependent_frequency",
    "rest_drift",
    "sideways_mode",
    "quantised",
    "short_record",
    "overdamped",
    "no_oscillation",
    "truncated_row",
    "stale_header",
}
UNITS = {
    "period": "s",
    "frequency": "Hz",
    "angular_frequency": "rad/s",
    "amplitude": "m",
    "offset": "m",
    "phase": "rad",
    "noise": "m",
    "damping_rate": "1/s",
    "quality_factor": "",
    "velocity_rms": "m/s",
}
WITH_SCENE = {
    "spring_constant": "N/m",
    "reynolds_number": "",
    "reynolds_number_start": "",
    "keulegan_carpenter_number": "",
    "drag_coefficient": "",
}
LAW_UNITS = {"A0": "m", "gamma": "1/s", "beta": "1/(m s)", "mu": "m/s", "c": None, "n": ""}
FILES = [
    "undamped_simulated_position.txt",
    "damped_simulated_position.txt",
    "clipped_simulated_position.txt",
    "cropped_simulated_position.txt",
    "sixty_hz_simulated_position.txt",
]


def is_number(value: object) -> bool:
    """Tell a JSON number that is finite, or null, from anything else."""
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value))


def check_estimate(estimate: Mapping[str, Any]) -> None:
    """Demand value, standard uncertainty and unit."""
    assert set(estimate) == {"value", "u", "unit"}
    assert is_number(estimate["value"])
    assert is_number(estimate["u"])
    assert isinstance(estimate["unit"], str)


def check_law(law: Mapping[str, Any]) -> None:
    """Demand the parameters of a damping law with their units, and how well it fits."""
    assert set(law) == {"parameters", "reduced_chi2", "dof", "bic", "rejected"}
    assert isinstance(law["rejected"], bool)
    assert all(is_number(law[name]) for name in ("reduced_chi2", "dof", "bic"))
    for name, parameter in law["parameters"].items():
        check_parameter(parameter)
        assert LAW_UNITS[name] in (None, parameter["unit"])


def check_parameter(parameter: Mapping[str, Any]) -> None:
    """Demand an estimate, and the limit of one that is not determined."""
    estimate = dict(parameter)
    assert estimate.pop("determined") is (estimate.pop("upper_limit") is None)
    check_estimate(estimate)


def check_schema(result: Mapping[str, Any]) -> None:
    """Demand the object of schema 1: these keys, no others, of these types."""
    assert list(result) == [
        "schema",
        "input",
        "recorded",
        "quality",
        "estimates",
        "budget",
        "correlations",
        "damping",
        "effects",
        "findings",
        "provenance",
    ]
    assert result["schema"] == 2
    types = {
        "path": str,
        "format": str,
        "sha256": str,
        "kind": str,
        "channel": str,
        "samples": int,
        "rate_hz": float,
        "duration_s": float,
    }
    assert {name: type(value) for name, value in result["input"].items()} == types
    assert result["input"]["kind"] in ("live", "replay", "simulated")
    assert set(result["quality"]) == {
        "missing",
        "false_echo",
        "clipped",
        "duplicate_time",
        "non_monotonic_time",
        "outside",
        "malformed_rows",
        "used",
    }
    assert {type(count) for count in result["quality"].values()} == {int}
    for estimate in result["estimates"].values():
        check_estimate(estimate)
    assert set(result["correlations"]["names"]) == set(result["budget"])
    matrix = result["correlations"]["matrix"]
    assert np.array_equal(matrix, np.transpose(matrix))
    assert len(matrix) == len(result["budget"])
    for each in result["budget"].values():
        assert each["expanded"] == pytest.approx(each["coverage_factor"] * each["u"])
        assert is_number(each["dof"])
    damping = result["damping"]
    assert set(damping) == {
        *("selected", "admissible", "stated", "law", "weights", "of_law", "coefficients", "leading", "laws")
    }
    assert set(damping["of_law"]) <= set(result["estimates"])
    for coefficient in damping["coefficients"].values():
        check_parameter({name: value for name, value in coefficient.items() if name != "law"})
    assert damping["selected"] is None or damping["selected"] in damping["laws"]
    assert set(damping["admissible"]) <= set(damping["laws"])
    for law in damping["laws"].values():
        check_law(law)
    for effect in result["effects"]:
        assert set(effect) == {"name", "predicted", "measured", "unit", "included", "why"}
        assert is_number(effect["predicted"])
        assert is_number(effect["measured"])
        assert isinstance(effect["included"], bool)
        assert all(isinstance(effect[name], str) for name in ("name", "unit", "why"))
    for finding in result["findings"]:
        assert set(finding) == {"code", "severity", "message", "details", "values", "advice"}
        assert finding["severity"] in ("info", "warning", "error")
        assert "\n" not in finding["message"]
    assert set(result["provenance"]) == {"version", "accuracy", "parameters", "time_utc"}
    assert result["provenance"]["version"] == springmass.__version__


@pytest.mark.parametrize("name", FILES)
def test_the_json_has_the_promised_schema(cli: Cli, data: Path, name: str) -> None:
    """Every bundled recording gives one line of JSON, nothing else on stdout and nothing on stderr."""
    done = cli("analyse", "--json", data / name)
    assert (done.code, done.err) == (0, "")
    (result,) = done.results
    check_schema(result)
    assert {f["code"] for f in result["findings"]} <= CODES
    assert {name: e["unit"] for name, e in result["estimates"].items()} == UNITS
    assert (result["input"]["path"], result["input"]["kind"]) == (str(data / name), "simulated")
    assert set(result["damping"]["laws"]) >= {"none", "linear", "quadratic", "linear+quadratic"}


def test_a_scene_adds_what_it_makes_known(cli: Cli, data: Path) -> None:
    """With masses, disc and air the spring constant and the numbers of the flow are there."""
    done = cli("analyse", "--json", data / "damped_simulated_position.txt", "--scene", data / "damped.scene.toml")
    assert done.code == 0
    (result,) = done.results
    check_schema(result)
    assert {name: e["unit"] for name, e in result["estimates"].items()} == UNITS | WITH_SCENE
    assert result["provenance"]["parameters"]["scene"]["bob"]["mass_kg"]


def test_one_line_for_each_input_in_their_order(cli: Cli, data: Path) -> None:
    """Several inputs give as many objects, each naming its file."""
    paths = [data / name for name in (FILES[3], FILES[0], FILES[4])]
    done = cli("analyse", "--json", *paths)
    assert done.code == 0
    assert [result["input"]["path"] for result in done.results] == [str(path) for path in paths]


def test_a_bad_input_does_not_keep_the_others_from_theirs(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """One of three cannot be read: two results, one line on stderr, exit code 1."""
    done = cli("analyse", "--json", recording, tmp_path / "absent.txt", recording)
    assert (done.code, len(done.results)) == (1, 2)
    assert "absent.txt" in done.complaint


def test_seconds_that_one_input_lacks_do_not_keep_the_others_from_theirs(
    cli: Cli, write: Callable[..., Path], rows: list[bytes]
) -> None:
    """A window past the end of one record fails that one."""
    short, long = write(rows[:300], "short.txt"), write(rows, "long.txt")
    done = cli("analyse", "--json", "--from", "4", short, long)
    assert (done.code, [r["input"]["path"] for r in done.results]) == (1, [str(long)])
    assert "short.txt: no sample lies between 4 and inf s; the record spans 0 to 2.99 s" in done.complaint


def test_a_run_file_with_an_impossible_scene_fails_alone(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The scene inside a run file belongs to that input; its error names the file."""
    run = springmass.load(recording)
    bad = springmass.write_run(tmp_path / "bad.h5", [run.samples], run.info, scene={"bob": {"mass_kg": -1.0}})
    done = cli("analyse", "--json", bad, recording)
    assert (done.code, len(done.results)) == (1, 1)
    assert "bad.h5" in done.complaint
    assert cli("analyse", "--json", bad).code == 3


def test_all_inputs_bad_is_unreadable(cli: Cli, tmp_path: Path) -> None:
    """Where nothing could be read the exit code says that, with a line for each."""
    done = cli("analyse", "--json", tmp_path / "a.txt", tmp_path / "b.txt")
    assert (done.code, done.out, len(done.err.splitlines())) == (3, "", 2)


def test_strict_passes_what_only_warns(cli: Cli, write: Callable[..., Path], rows: list[bytes]) -> None:
    """A warning is no reason to reject."""
    done = cli("analyse", "--json", "--strict", write([*rows[:-1], b"9.99\t0."]))
    assert (done.code, done.err) == (0, "")
    assert "warning" in {f["severity"] for f in done.results[0]["findings"]}


def test_strict_rejects_an_error(cli: Cli, recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A finding that forbids the use of a number gives exit code 5, but only where strictness was asked for."""
    error = Finding("two_modes", "error", "Two oscillations overlap.")
    monkeypatch.setattr("springmass.runs.analysing.with_traps", lambda *_: (error,))
    done = cli("analyse", "--json", "--strict", recording)
    assert (done.code, len(done.results)) == (5, 1)
    assert done.complaint.endswith("run.txt: rejected under --strict: two_modes")
    assert cli("analyse", "--json", recording).code == 0


def test_from_and_to_cut_the_record(cli: Cli, recording: Path) -> None:
    """Only samples of the seconds asked for are analysed, both ends included."""
    done = cli("analyse", "--json", "--from", "2", "--to", "6.5", recording)
    (result,) = done.results
    assert (result["input"]["samples"], result["input"]["duration_s"]) == (451, 4.5)
    assert sum(result["quality"][name] for name in ("false_echo", "used")) == 451
    assert (result["provenance"]["parameters"]["from_s"], result["provenance"]["parameters"]["to_s"]) == (2.0, 6.5)


@pytest.mark.parametrize("window", [("--from", "20"), ("--to", "-1"), ("--from", "5", "--to", "4")])
def test_seconds_outside_the_record_are_a_usage_error(cli: Cli, recording: Path, window: tuple[str, ...]) -> None:
    """The line says what the record spans."""
    done = cli("analyse", "--json", recording, *window)
    assert (done.code, done.out) == (2, "")
    assert "the record spans 0 to 9.99 s" in done.complaint


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[bob]\nmas_kg = 0.2\n", ("mas_kg",)),
        ("[bob]\nmass_kg = -0.2\n", ("mass_kg", "-0.2")),
        ("[bob]\nmass_g = 217.6\n", ("mass_g",)),
        ("[bob]\nmass_kg = '0.2'\n", ("mass_kg", "0.2")),
        ("[bob]\nmass_kg = {value = 0.2, u = -1.0}\n", ("mass_kg", "u", "-1")),
        ("[bob]\nmass_kg = nan\n", ("mass_kg", "nan")),
        ("[weight]\nmass_kg = 0.2\n", ("weight",)),
        ("bob = 3\n", ("bob", "3")),
        ("[sensor]\nposition = 'left'\n", ("position", "left")),
        ("[air]\nrelative_humidity = 40\n", ("relative_humidity", "40")),
        ("[bob\n", ("not a TOML file", "line 1")),
    ],
)
def test_an_impossible_scene_is_one_line(
    cli: Cli, recording: Path, tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    """Exit code 2 and a line that names file, key and value, before any input is read."""
    scene = tmp_path / "bench.toml"
    scene.write_text(text)
    done = cli("analyse", "--json", recording, "--scene", scene)
    assert (done.code, done.out) == (2, "")
    assert all(word in done.complaint for word in (str(scene), *words))


@pytest.mark.parametrize("kind", ["absent", "folder", "latin1"])
def test_a_scene_that_cannot_be_read_is_one_line(cli: Cli, recording: Path, tmp_path: Path, kind: str) -> None:
    """A missing file, a folder and another encoding are usage errors."""
    scene = tmp_path / "bench.toml"
    if kind == "folder":
        scene.mkdir()
    if kind == "latin1":
        scene.write_text("# Höhe\n[bob]\nmass_kg = 0.2\n", encoding="latin-1")
    done = cli("analyse", "--json", recording, "--scene", scene)
    assert (done.code, done.out) == (2, "")
    assert str(scene) in done.complaint


def test_the_classic_method_gives_the_reports_numbers(cli: Cli, data: Path) -> None:
    """Its estimates are those of the library's call, it fits no laws, and the accuracy says what it is."""
    position, velocity = (data / f"damped_simulated_{what}.txt" for what in ("position", "velocity"))
    scene = data / "damped.scene.toml"
    done = cli("analyse", "--json", "--method", "classic", position, "--velocity", velocity, "--scene", scene)
    assert done.code == 0
    (result,) = done.results
    check_schema(result)
    own = classic(springmass.load(position, velocity=velocity).track, springmass.read_scene(scene))
    assert {n: e["value"] for n, e in result["estimates"].items()} == {n: e.value for n, e in own.estimates.items()}
    assert result["provenance"]["accuracy"] == "classic"
    assert not any(result["damping"].values())


@pytest.mark.parametrize("accuracy", ["fast", "standard", "best"])
def test_a_tier_is_what_the_result_says_it_is(cli: Cli, data: Path, accuracy: str) -> None:
    """The estimates under --accuracy are those of the library's tier, and the provenance names it."""
    path = data / "undamped_simulated_position.txt"
    result = cli("analyse", "--json", "--accuracy", accuracy, path).results[0]
    own = springmass.analyse(springmass.load(path).track, params=params_for(accuracy))
    assert {n: e["value"] for n, e in result["estimates"].items()} == {n: e.value for n, e in own.estimates.items()}
    assert result["provenance"]["accuracy"] == accuracy


def test_a_velocity_file_is_joined(cli: Cli, data: Path) -> None:
    """The pair gives the period of the position file alone, and samples of both."""
    position, velocity = (data / f"undamped_simulated_{what}.txt" for what in ("position", "velocity"))
    pair, alone = cli("analyse", "--json", position, "--velocity", velocity), cli("analyse", "--json", position)
    assert (pair.code, alone.code) == (0, 0)
    a, b = (done.results[0]["estimates"]["period"] for done in (pair, alone))
    assert abs(a["value"] - b["value"]) < b["u"]
    assert pair.results[0]["provenance"]["parameters"]["velocity"] == str(velocity)


def test_a_velocity_file_for_several_inputs_is_refused(cli: Cli, data: Path) -> None:
    """It belongs to one position file."""
    position, velocity = (data / f"undamped_simulated_{what}.txt" for what in ("position", "velocity"))
    done = cli("analyse", "--json", position, position, "--velocity", velocity)
    assert (done.code, done.out) == (2, "")
    assert "--velocity completes one position file, got 2 inputs" in done.complaint


@pytest.mark.parametrize(
    "options",
    [
        ["--rate-hz", "0"],
        ["--rate-hz", "nan"],
        ["--from", "inf"],
        ["--from", "soon"],
        ["--method", "best"],
        ["--accuracy", "guess"],
        ["--nonsense"],
    ],
)
def test_options_that_cannot_be_are_a_usage_error(cli: Cli, recording: Path, options: list[str]) -> None:
    """Exit code 2, nothing on stdout, and no traceback."""
    done = cli("analyse", "--json", recording, *options)
    assert (done.code, done.out) == (2, "")
    assert "Traceback" not in done.err
    assert options[0] in done.err


def test_json_writes_no_files(cli: Cli, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are files only where a folder for them was named."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert cli("analyse", "--json", recording).code == 0
    assert list(here.iterdir()) == []


@pytest.mark.trials
def test_files_of_one_name_get_results_of_their_own(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Recordings are called data.txt in one folder after the other; none overwrites another's results."""
    paths = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        paths.append(tmp_path / folder / "data.txt")
        paths[-1].write_bytes(recording.read_bytes())
    out = tmp_path / "deep" / "out"
    done = cli("analyse", "--json", "--report", "--out", out, *paths)
    assert done.code == 0
    pages = [out / name / "report.html" for name in ("data.results", "data-2.results")]
    assert done.err.splitlines() == [
        *(f"report: {page}" for page in pages),
        f"written: {out / 'together.results' / 'results.csv'}",
    ]
    assert all(page.is_file() for page in pages)
    assert len(done.results) == 2


def test_a_folder_that_cannot_be_made_is_one_line(cli: Cli, recording: Path) -> None:
    """A file stands where the results should go: a usage error before the work, not a traceback after it."""
    done = cli("analyse", recording, "--out", recording)
    assert (done.code, done.out) == (2, "")
    assert f"{recording}: cannot make the folder for results (File exists)" in done.complaint


def test_a_name_that_no_terminal_can_show_is_shown_escaped(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A name of bytes without meaning and one with a line break stay on one line each."""
    odd = tmp_path / "a\udcff\nb.txt"
    assert "a\\udcff b.txt: cannot be opened" in cli("analyse", "--json", odd).complaint


def test_json_says_the_same_each_time(cli: Cli, recording: Path) -> None:
    """Two analyses of one file differ in the time of the analysis alone."""
    first, second = (cli("analyse", "--json", recording).results[0] for _ in range(2))
    for result in (first, second):
        result["provenance"].pop("time_utc")
    assert first == second


def test_the_module_runs_as_a_program(recording: Path, tmp_path: Path) -> None:
    """``python -m springmass`` elsewhere, in a separate process: JSON on stdout, the exit code of the command."""
    command = [sys.executable, "-W", "error", "-m", "springmass", "analyse", "--json"]
    done = subprocess.run(
        [*command, str(recording), "absent.txt"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    result = json.loads(done.stdout)
    check_schema(result)
    assert np.isclose(result["estimates"]["period"]["value"], 0.7585, atol=5e-4)
    assert done.stderr.startswith("springmass: absent.txt: cannot be opened")
    assert len(done.stderr.splitlines()) == 1


def test_both_streams_come_in_their_order_in_one_file(recording: Path, tmp_path: Path) -> None:
    """Into one log (`> log 2>&1`) the table comes before the line that names the report, buffered or not."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    command = [sys.executable, "-m", "springmass", "analyse", str(recording), "--out", "results"]
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=True,
        cwd=tmp_path,
        env=environment,
    )
    lines = done.stdout.splitlines()
    assert lines[0].startswith("quantity")
    assert lines[-1].startswith("report: ")
