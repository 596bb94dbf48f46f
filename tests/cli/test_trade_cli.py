"""`springmass trade`: the measurement in a table, as JSON and drawn; own records; what cannot be asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from springmass.terminal.progress import TaskProgress
from springmass.trade.truth import HOSTILE

Cli = Callable[..., Any]
SHORT = ("--seeds", "3", "--seconds", "8")
REFERENCES = ["classic", "zero_crossings", "fft_peak", "hilbert", "scipy"]


def test_the_table_names_every_method_and_recommends_a_tier(cli: Cli) -> None:
    """Three tiers and five references with their errors over the bound, and one of the tiers is recommended."""
    done = cli("trade", *SHORT)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0].startswith("3 simulated records of 8 s at 100 Hz")
    for label in (
        "springmass fast",
        "springmass standard",
        "springmass best",
        "classic lab method",
        "scipy damped sine",
    ):
        assert sum(line.startswith(label) for line in lines) == 1
    assert lines[-1].startswith("Recommended for such records: --accuracy ")


def test_the_json_is_the_same_but_for_times(cli: Cli) -> None:
    """Two measurements with one set of seeds give the same errors; times, and what follows from them, may differ."""

    def errors(result: dict[str, Any]) -> list[Any]:
        return [(m["name"], m["error_over_bound"], m["bias_over_bound"], m["failed"]) for m in result["methods"]]

    (first,), (second,) = (cli("trade", "--json", *SHORT).results for _ in range(2))
    assert errors(first) == errors(second)
    assert [m["name"] for m in first["methods"]] == ["fast", "standard", "best", *REFERENCES]
    assert all(m["time_s"] > 0 for m in first["methods"])
    assert first["recommended"] in ("fast", "standard", "best")
    assert first["truth"]["seconds"] == 8.0


@pytest.mark.trials
def test_figure_and_numbers_are_written(cli: Cli, tmp_path: Path) -> None:
    """--out makes the folder, a figure of each kind and the numbers."""
    done = cli(
        "trade", *SHORT, "--noise-m", "0.00239", "--echoes", "0.02", "--damping", "0.02", "--out", tmp_path / "new"
    )
    assert done.code == 0
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == ["trade.json", "trade.pdf", "trade.svg"]
    picture = (tmp_path / "new" / "trade.svg").read_text(encoding="utf-8")
    for words in (
        "frequency error / bound",
        "damping error / bound",
        "Pareto front",
        "classic lab method",
        "springmass standard",
    ):
        assert words in picture


def test_a_record_goes_before_every_method(cli: Cli, recording: Path) -> None:
    """INPUT: what each method finds on it, with its time; all periods agree within a hundredth."""
    done = cli("trade", recording)
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith(f"{recording}, by every method")
    (result,) = cli("trade", "--json", recording).results
    assert result["kind"] == "record"
    periods = {m["name"]: m["estimates"]["period"]["value"] for m in result["methods"]}
    assert list(periods) == ["fast", "standard", "best", *REFERENCES]
    assert all(value == pytest.approx(periods["best"], rel=0.01) for value in periods.values())


def test_the_tiers_go_through_what_spoils_a_record(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    """--hostile: a line a kind of record, every tier with its errors over the least; the same as JSON."""
    kinds = {name: HOSTILE[name] for name in ("3 periods", "20 % false echoes")}
    monkeypatch.setattr("springmass.trade.truth.HOSTILE", kinds)
    done = cli("trade", "--hostile", "--seeds", "2")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("2 simulated records of each kind")
    assert [sum(line.startswith(name) for line in done.out.splitlines()) for name in kinds] == [1, 1]
    (result,) = cli("trade", "--hostile", "--seeds", "2", "--json").results
    assert [each["record"] for each in result["records"]] == list(kinds)
    for each in result["records"]:
        assert [method["name"] for method in each["methods"]] == ["fast", "standard", "best"]
        assert min(method["error_over_least"]["frequency"] for method in each["methods"]) == 1.0
        assert all(method["failed"] == 0 and method["error"]["frequency"] < 0.1 for method in each["methods"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--seeds", "0"), "must be 1 or more"),
        (("--noise-m", "-1"), "must be positive"),
        (("--echoes", "0.9"), "must lie in 0 to 0.4"),
        (("--damping", "-0.1"), "must not be negative"),
        (("--seconds", "1"), "two periods"),
        (("--hostile", "--echoes", "0.1"), "only --seeds and --json; got echoes"),
        (("--integrators", "--seeds", "3"), "only -o and --json; got seeds"),
    ],
)
def test_what_cannot_be_measured_is_refused(cli: Cli, arguments: tuple[str, ...], words: str) -> None:
    """Options out of their range end with exit code 2 and say what is allowed."""
    done = cli("trade", *arguments)
    assert (done.code, done.out) == (2, "")
    assert words in done.err


def test_simulated_records_and_an_own_one_exclude_each_other(cli: Cli, recording: Path) -> None:
    """Options that describe simulated records do nothing on an own record, so they are refused with it."""
    done = cli("trade", recording, "--seeds", "5", "--out", "x")
    assert (done.code, done.out) == (2, "")
    assert "--seeds, --out" in done.complaint


def test_ctrl_c_ends_with_130(cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Interrupted in the middle: one line, exit code 130, and no half-written file."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(TaskProgress, "update", interrupt)
    done = cli("trade", *SHORT, "--out", tmp_path / "out")
    assert (done.code, done.out) == (130, "")
    assert done.complaint == "springmass: interrupted"
    assert list((tmp_path / "out").iterdir()) == []
