"""A damping law on the command line: stated by an option, a scene file or a table of runs."""

from pathlib import Path

import numpy as np
import pytest

import springmass
from tests.cli.conftest import Cli
from tests.courses import rows_of

RUN = "undamped_simulated_position.txt"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a recording in an empty folder."""
    path = tmp_path / "bob.txt"
    # With one byte more it is no bundled recording, beside which nothing is noted.
    path.write_bytes((springmass.sample_data() / RUN).read_bytes() + b"\n")
    return path


def test_a_law_of_a_scene_file_is_named_first(cli: Cli, run: Path) -> None:
    """The first line of the output names the law; an option takes precedence over the file."""
    bench = run.with_name("bench.toml")
    bench.write_text('[bob]\nmass_kg = 0.2\n[damping]\nlaw = "linear"\ngamma_per_s = 0.5\n')
    assert "linear" in cli("analyse", run, "--scene", bench, "--no-report").out.splitlines()[0]
    (free,) = cli("analyse", run, "--scene", bench, "--law", "any", "--json").results
    assert free["damping"]["stated"] is None


def test_batch_takes_a_law_for_all_runs_and_for_each(cli: Cli, run: Path) -> None:
    """The column law of the table of runs takes precedence over the option; the results have both laws."""
    other = run.with_name("other.txt")
    other.write_bytes(run.read_bytes())
    table = run.parent / "runs.csv"
    table.write_text("path,law\nother.txt,quadratic\n")
    folder = run.parent / "course"
    done = cli("batch", run, other, "--runs", table, "--law", "linear", "-o", folder, "--jobs", "1", "--reports", "0")
    assert done.code == 0, done.err
    rows = {row["run"]: row for row in rows_of(folder / "results.csv")}
    assert {name: row["stated_law"] for name, row in rows.items()} == {"bob": "linear", "other": "quadratic"}
    assert rows["bob"]["law"] == rows["bob"]["one_law"] == "linear"
    table.write_text("path,law\nother.txt,cubic\n")
    wrong = cli("batch", run, other, "--runs", table, "-o", folder, "--jobs", "1", "--reports", "0")
    assert wrong.code == 2
    assert "law must be one of" in wrong.complaint


def test_a_damping_rate_that_is_not_to_be_quoted_is_not_recommended(cli: Cli, tmp_path: Path) -> None:
    """Table 1 and the sentence on damping agree about it, and the sentence counts the seconds that were analysed."""
    t, rng = np.arange(1400) / 100, np.random.default_rng(1)
    y = 0.2 + np.where(t < 4.0, 0.1, 0.02 * np.cos(8.0 * t) * np.exp(-5e-4 * t)) + 1e-3 * rng.standard_normal(t.size)
    path = tmp_path / "weak.csv"
    path.write_text("time (s),distance (m)\n" + "".join(f"{a:.2f},{b:.5f}\n" for a, b in zip(t, y, strict=True)))
    out = " ".join(cli("analyse", path, "--no-report").out.split())
    assert "lambda" in out.partition("Do not quote: ")[2].partition(". ")[0]
    assert "may be quoted" not in out
    assert "in 7 s" in out  # all that is left when it moves freely
