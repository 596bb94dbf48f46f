"""``springmass compare --reported``: mistakes in what somebody printed, on the terminal, in JSON and on the page."""

import math
from pathlib import Path

import pytest

from tests.cli.conftest import Cli
from tests.reported import Row, record, write_table
from tests.synthetic import Truth

# Table 1 and the conclusion of the report, with the units of its own lines.
PRINTED: list[Row] = [
    ("bare", "period", 0.753, 0.001, "s"),
    ("bare", "f", 1.33, 0.002, "Hz"),
    ("bare", "omega", 8.35, 0.01, "s^-1"),
    ("bare", "k", "14.0", 0.002, "N/m"),
    ("bare", "A", 0.05914, 0.000004, "cm"),
    ("disc", "period", 0.726, 0.001, "s"),
    ("disc", "f", 1.38, 0.002, "Hz"),
    ("disc", "omega", 8.66, 0.01, "s^-1"),
    ("disc", "k", 16.311, 0.003, "N/m"),
    ("disc", "sensor_error", 0.00239, "", "m"),
    ("disc", "gamma", 0.01463, 0.0000000002, "1/s"),
    ("disc", "v_rms", 0.18073, 0.000007, "m/s"),
    ("disc", "Re", 1220, 300, ""),
]
SIX = ["exchanged", "power_of_ten", "u_too_small", "not_noise", "false_echoes", "not_exponential"]


@pytest.fixture
def bench(tmp_path: Path) -> list[str]:
    """Return the arguments that name runs like the report's, whose periods are those that it printed, exchanged."""
    bare = Truth(amplitude=0.05914, omega=2 * math.pi * 7 / 5.08, gamma=0.002)
    disc = Truth(amplitude=0.05092, omega=2 * math.pi * 7 / 5.27, gamma=0.0073, beta=0.235)
    arguments: list[str] = []
    for name, truth, mass, seconds, echoes in (("bare", bare, 0.2007, 10, 0), ("disc", disc, 0.2176, 120, 36)):
        record(tmp_path, name, truth, mass, seconds, noise_m=1e-4, echoes=echoes, seed=1)
        (tmp_path / f"{name}.toml").write_text(
            f"[bob]\nmass_kg = {{ value = {mass}, u = 0.00005 }}\n[disc]\ndiameter_m = 0.102\n"
            "[air]\ntemperature_c = 20\n"
        )
        arguments += [str(tmp_path / f"{name}_position.txt"), "--scene", str(tmp_path / f"{name}.toml")]
    return arguments


def test_six_of_six_on_the_reports_own_table(bench: list[str], tmp_path: Path, cli: Cli) -> None:
    """Each mistake has its line on the terminal, in the JSON and on the page; --strict rejects the table."""
    table = write_table(tmp_path / "printed.csv", PRINTED)
    done = cli("compare", *bench, "--reported", table, "-o", tmp_path / "out", "--strict")
    printed, page = done.out, (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert done.code == 5
    (result,) = cli("compare", *bench, "--reported", table, "--json").results
    codes = {finding["code"] for finding in result["findings"]}
    for code in SIX:
        for where in (printed, page, codes):
            assert f"reported_{code}" in where
    assert "reported_differs" not in codes
    assert len(result["reported"]) == len(PRINTED)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("other,period,0.7,,s", "must be one of"),
        ("bare,period,fast,,s", "value must be a number"),
        ("bare,period,0.7,-1,s", "u must be a number"),
        ("bare,period,0.7,,kg", "give s"),
        ("bare,period", "value must be a number"),
        ("bare,period,1e400,,s", "value must be a number"),
    ],
)
def test_a_table_that_cannot_be_read_names_the_line(
    bench: list[str], tmp_path: Path, cli: Cli, line: str, words: str
) -> None:
    """The error names file and line, and says what to write."""
    table = tmp_path / "t.csv"
    table.write_text(f"run,name,value,u,unit\n{line}\n")
    done = cli("compare", *bench, "--reported", table)
    assert (done.code, "t.csv, line 2" in done.complaint, words in done.complaint) == (2, True, True)


def test_a_velocity_is_accused_of_false_echoes_only_beyond_its_u(bench: list[str], tmp_path: Path, cli: Cli) -> None:
    """A Reynolds number within the u that is printed with it agrees; without recorded velocities it is only perhaps."""
    for u, agrees in ((300, True), (3, False)):
        table = write_table(tmp_path / f"{u}.csv", [("disc", "Re", 1220, u, "")])
        (result,) = cli("compare", *bench, "--reported", table, "--json").results
        (row,) = result["reported"]
        assert (row["verdict"] == "agrees") is agrees
        assert ("perhaps" in row["verdict"]) is not agrees
        accused = [f["code"] for f in result["findings"] if "echoes" in f["code"]]
        assert accused == ([] if agrees else ["reported_false_echoes"])
