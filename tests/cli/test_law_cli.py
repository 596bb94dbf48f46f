"""A damping law on the command line: stated by an option, a scene file or a table of runs."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import springmass
from tests.cli.conftest import Done

RUN = "undamped_simulated_position.txt"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a recording in an empty folder."""
    path = tmp_path / "bob.txt"
    # With one byte more it is no bundled recording, beside which nothing is noted.
    path.write_bytes((springmass.sample_data() / RUN).read_bytes() + b"\n")
    return path


def scene(folder: Path, law: str) -> Path:
    """Return a scene file that states a law."""
    path = folder / "bench.toml"
    path.write_text(f'[bob]\nmass_kg = 0.2\n[damping]\nlaw = "{law}"\ngamma_per_s = 0.5\n')
    return path


def test_a_law_is_stated_by_an_option_and_never_noted(cli: Callable[..., Done], run: Path) -> None:
    """The result holds the law, and nothing is written next to the recording."""
    done = cli("analyse", run, "--law", "linear", "--json")
    (result,) = done.results
    damping = result["damping"]
    assert (damping["selected"], damping["stated"], damping["law"]) == ("linear", "linear", "linear")
    assert result["provenance"]["parameters"]["law"] == "linear"
    assert "law" not in result["provenance"]["parameters"]["scene"].get("damping", {})
    assert result["estimates"]["damping_rate"]["value"] == pytest.approx(damping["coefficients"]["gamma"]["value"])
    assert not list(run.parent.glob("*.about.toml"))


def test_a_law_of_a_scene_file_is_named_first(cli: Callable[..., Done], run: Path) -> None:
    """The first line of the output names law and file; an option takes precedence over the file."""
    bench = scene(run.parent, "linear")
    first = cli("analyse", run, "--scene", bench, "--no-report").out.splitlines()[0]
    assert "linear" in first
    assert str(bench) in first
    (free,) = cli("analyse", run, "--scene", bench, "--law", "any", "--json").results
    assert free["damping"]["stated"] is None


def test_table_1_has_the_coefficients_of_one_law_that_is_known(cli: Callable[..., Done], run: Path) -> None:
    """Of seven seconds that several laws describe it shows no coefficient, but those of a stated law."""
    free, stated = cli("analyse", run, "--no-report").out, cli("analyse", run, "--law", "linear", "--no-report").out
    names = ("linear damping", "quadratic damping", "dry friction, ")
    assert [name in free for name in names] == [False, False, False]
    assert [name in stated for name in names] == [True, False, False]
    assert "damping rate at the start" in free


def test_the_growth_of_forward_euler_is_measured(cli: Callable[..., Done], tmp_path: Path) -> None:
    """Its amplitude grows by sqrt(1 + w^2 h^2) a step; no sentence says that no law fits."""
    omega, h, noise = 8.3, 0.002, 1e-4
    x, v, rows = 0.05, 0.0, []
    rng = np.random.default_rng(1)
    for i in range(5000):
        if i % 5 == 0:
            rows.append(f"{i * h:.2f},{0.25 + x + noise * rng.standard_normal():.6f}\n")
        x, v = x + h * v, v - h * omega**2 * x
    table = tmp_path / "euler.csv"
    table.write_text("time (s),distance (m)\n" + "".join(rows))
    (result,) = cli("analyse", table, "--json").results
    rate = result["estimates"]["damping_rate"]
    assert rate["value"] == pytest.approx(-0.5 * np.log1p((omega * h) ** 2) / h, abs=4.0 * rate["u"])
    assert rate["u"] < 1e-3 * abs(rate["value"])
    codes = {each["code"] for each in result["findings"]}
    assert "growing" in codes
    assert "no_law_fits" not in codes


def test_numbers_are_called_sound_uncertain_or_not_to_be_quoted(cli: Callable[..., Done], run: Path) -> None:
    """T is sound, k without the mass of the spring is uncertain, and results by a wrong law are not to be quoted."""

    def groups(*options: str) -> dict[str, str]:
        text = " ".join(cli("analyse", run, *options, "--no-report").out.split())
        found = re.findall(r"(Sound|Uncertain|Do not quote): (.*?)\.(?= |$)", text)
        return {grade: re.sub(r" \(.*?\)", "", symbols) for grade, symbols in found}

    usual = groups("--mass-kg", "0.2")
    assert {"T", "f", "A0"} <= set(usual["Sound"].split(", "))
    assert "k" in re.split("[,;] ", usual["Uncertain"])
    damped = springmass.sample_data() / "damped_simulated_position.txt"
    run.write_bytes(damped.read_bytes() + b"\n")
    wrong = groups("--law", "friction")
    assert {"lambda", "Q", "mu"} <= set(re.split("[,;] ", wrong["Do not quote"]))
    assert "T" in wrong["Sound"].split(", ")


def test_a_law_that_does_not_exist_is_refused(cli: Callable[..., Done], run: Path) -> None:
    """Option and scene file list the laws."""
    assert "linear+quadratic" in cli("analyse", run, "--law", "cubic", "--no-report").complaint
    done = cli("analyse", run, "--scene", scene(run.parent, "cubic"), "--no-report")
    assert done.code == 2
    assert "linear+quadratic" in done.complaint


def test_batch_takes_a_law_for_all_runs_and_for_each(cli: Callable[..., Done], run: Path) -> None:
    """The column law of the table of runs takes precedence over the option; the results have both laws."""
    other = run.with_name("other.txt")
    other.write_bytes(run.read_bytes())
    table = run.parent / "runs.csv"
    table.write_text("path,law\nother.txt,quadratic\n")
    folder = run.parent / "course"
    done = cli("batch", run, other, "--runs", table, "--law", "linear", "-o", folder, "--jobs", "1", "--reports", "0")
    assert done.code == 0, done.err
    (results,) = folder.glob("*.csv")
    with results.open(newline="") as file:
        rows = {row["run"]: row for row in csv.DictReader(file)}
    assert {name: row["stated_law"] for name, row in rows.items()} == {"bob": "linear", "other": "quadratic"}
    assert rows["bob"]["law"] == rows["bob"]["one_law"] == "linear"
    table.write_text("path,law\nother.txt,cubic\n")
    wrong = cli("batch", run, other, "--runs", table, "-o", folder, "--jobs", "1", "--reports", "0")
    assert wrong.code == 2
    assert "law must be one of" in wrong.complaint
