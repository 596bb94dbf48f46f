"""Records that hold no oscillation, or one that a sensor spoiled, on the command line: a finding or the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.sampling import sampled

Cli = Callable[..., Any]
Write = Callable[..., Path]
T = np.arange(1000) / 100


def swing(seed: int = 4) -> np.ndarray:
    """Return ten seconds of a sound record, m."""
    noise = 3e-4 * np.random.default_rng(seed).standard_normal(T.size)
    return 0.22 + 0.05 * np.exp(-0.01 * T) * np.cos(8.3 * T) + noise


def as_rows(y_m: np.ndarray, t_s: np.ndarray = T) -> list[bytes]:
    """Return the rows of a position file."""
    return [f"{t:.3f}\t{100 * y:.4f}\t0.239".encode() for t, y in zip(t_s, y_m, strict=True)]


@pytest.mark.parametrize("accuracy", sampled(["fast", "standard", "best"], 1))
@pytest.mark.parametrize(
    "y",
    [
        pytest.param(np.where(T < 5, 0.2, 0.3), id="step"),
        pytest.param(0.22 + 3e-4 * np.random.default_rng(1).standard_normal(T.size), id="white noise"),
        pytest.param(0.2 + 0.01 * T, id="ramp"),
    ],
)
def test_what_does_not_oscillate_ends_with_3(cli: Cli, write: Write, accuracy: str, y: np.ndarray) -> None:
    """A step, noise, a ramp: exit code 3, one line, and a result without a period whose first finding says why."""
    path = write(as_rows(y))
    done = cli("analyse", "--json", "--accuracy", accuracy, path)
    assert done.code == 3
    assert f"{path}: no oscillation" in done.complaint
    (result,) = done.results
    assert "period" not in result["estimates"]
    assert result["findings"][0]["code"] == "no_oscillation"


@pytest.mark.parametrize("accuracy", sampled(["fast", "standard", "best"], 1))
def test_values_that_are_none_cost_no_truth(cli: Cli, write: Write, accuracy: str) -> None:
    """NaN and infinite distances are counted as missing, and the period is the true one."""
    y = swing()
    y[::9], y[5::50] = math.nan, math.inf
    done = cli("analyse", "--json", "--accuracy", accuracy, write(as_rows(y)))
    assert (done.code, done.err) == (0, "")
    (result,) = done.results
    assert result["quality"]["missing"] == np.count_nonzero(~np.isfinite(y))
    period = result["estimates"]["period"]
    assert abs(period["value"] - 2 * math.pi / 8.3) <= 5 * period["u"]


@pytest.mark.parametrize("accuracy", sampled(["fast", "standard", "best"], 1))
def test_a_saturated_sensor_is_told(cli: Cli, write: Write, accuracy: str) -> None:
    """Crests cut on both sides: clipping is told, or nothing is estimated; the plateau is never the amplitude."""
    done = cli("analyse", "--json", "--accuracy", accuracy, write(as_rows(np.clip(swing(), 0.19, 0.25))))
    for result in done.results:
        codes = {finding["code"] for finding in result["findings"]}
        assert codes & {"clipped", "no_oscillation"}
        if amplitude := result["estimates"].get("amplitude"):
            assert abs(amplitude["value"] - 0.05) <= 5 * amplitude["u"]
