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
