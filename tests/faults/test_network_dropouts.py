"""Network sensors that drop out: readings that are late, in bursts, cut or lost move no period by more than its u.

The sensors are written here, from the pages of their wire forms: they share no code with the decoders. Time is
simulated; the bytes go through the recorder, recovery and the analysis of the command line. ``SPRINGMASS_TRIALS`` asks
for all 50.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.clock import VirtualClock
from acquisition.events import Lost, Reopened
from springmass.cli import main
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry
from tests.encoders import sealed
from tests.faults.conftest import frame_of
from tests.sampling import sampled

TRIALS = 50 if os.environ.get("SPRINGMASS_TRIALS") else 12
SECOND_NS = 1_000_000_000
START_NS = 3600 * SECOND_NS
READ_BYTES = 65536
HELD_BYTES = 250_000
"""A socket's buffer on the way: what a longer dropout adds is lost."""


def timed_line(number: int, device_us: int, distance_m: float) -> bytes:
    """One line of the line protocol, as docs/reference/line-protocol.md has it."""
    return sealed(f"R1,{number},{device_us % 2**32},{2e6 * distance_m / 344.0:.2f},2150,E")


def counted_line(number: int, device_us: int, distance_m: float) -> bytes:
    """A sketch's line: its counter and millimetres."""
    return f"{number};{distance_m * 1e3:.1f}\r\n".encode()


def frame(number: int, device_us: int, distance_m: float) -> bytes:
    """A reading of an A02YYUW."""
    return frame_of(round(distance_m * 1e3))


SENSORS: dict[str, tuple[Callable[[int, int, float], bytes], float, dict[str, Any]]] = {
    "line-protocol": (timed_line, 100.0, {}),
    "text-lines": (counted_line, 50.0, {"column": 1, "sequence": 0, "unit": "mm", "separator": ";"}),
    "ffhls": (frame, 10.0, {}),
}


@dataclass(frozen=True)
class Plan:
    """One recording: how long, which dropouts (from, to, whether the connection is lost), the clock's error in ppm."""

    family: str
    seconds: float
    dropouts: list[tuple[float, float, bool]]
    ppm: float
    period_s: float
    noise_m: float = 3e-4


def planned(rng: np.random.Generator) -> Plan:
    """Return a recording with one to three dropouts of random place and length, up to four fifths of it in all."""
    family = list(SENSORS)[int(rng.choice(3, p=[0.6, 0.2, 0.2]))]
    seconds = float(rng.uniform(15.0, 60.0))
    remaining, dropouts = 0.8 * seconds, []
    for _ in range(int(rng.integers(1, 4))):
        length = float(rng.uniform(0.05, 1.0)) * remaining
        start = float(rng.uniform(-0.2 * length, seconds - 0.5 * length))
        dropouts.append((start, start + length, bool(rng.random() < 0.25)))
        remaining -= length
    ppm = float(rng.uniform(-50.0, 50.0) if rng.random() < 0.5 else rng.uniform(-6000.0, 6000.0))
    return Plan(family, seconds, sorted(dropouts), ppm, float(rng.uniform(0.5, 1.5)))


def deliver(plan: Plan, recorder: Recorder, rng: np.random.Generator) -> None:
    """Send what the sensor sends through a network that drops out."""
    make, rate_hz, _ = SENSORS[plan.family]
    n = int(plan.seconds * rate_hz)
    device_s = np.arange(n) / rate_hz
    true_s = device_s / (1.0 + 1e-6 * plan.ppm)
    swing = 0.05 * np.exp(-0.012 * true_s) * np.cos(2.0 * np.pi * true_s / plan.period_s + 1.0)
    distance = 0.4 + swing + rng.normal(0.0, plan.noise_m, n)
    sent = [
        make(17 + i, 5_000_000 + round(1e6 * s), d) for i, (s, d) in enumerate(zip(device_s, distance, strict=True))
    ]
    arrival = true_s + 0.002 + rng.exponential(0.001, n)
    lost = np.zeros(n, np.bool_)
    for start, stop, broken in plan.dropouts:
        silent = (arrival >= start) & (arrival < stop)
        sizes = np.cumsum(np.array([len(frame) for frame in sent]) * silent)
        lost |= silent & (broken | (sizes > HELD_BYTES))
        # What was held comes at the speed of the link, a segment of 1400 bytes each 0.2 ms.
        arrival[silent] = stop + 2e-4 * (sizes[silent] // 1400)
    arrival = np.maximum.accumulate(arrival)
    broken_off = [(start, stop) for start, stop, broken in plan.dropouts if broken]
    events = sorted(
        [(start, Lost) for start, _ in broken_off] + [(stop, Reopened) for _, stop in broken_off], key=itemgetter(0)
    )
    here = 0
    while here < n:
        while events and events[0][0] <= arrival[here]:
            at, kind = events.pop(0)
            recorder.event(0, START_NS + round(at * 1e9), kind(port="socket://bench:4001"))
        there, data = here, b""
        while there < n and arrival[there] - arrival[here] < 1e-4 and len(data) < READ_BYTES:
            data += b"" if lost[there] else sent[there]
            there += 1
        if data:
            recorder.reads([(0, START_NS + round(arrival[here] * 1e9), data)])
        here = there


def analysed(
    plan: Plan, folder: Path, rng: np.random.Generator, capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[int, dict[str, Any]]:
    """Record a plan and return what ``analyse --json --strict`` makes of it, with its exit code."""
    _, rate_hz, options = SENSORS[plan.family]
    sensor = SensorEntry(0, plan.family, "socket://bench:4001", 9600, rate_hz, options)
    header = LogHeader(sensors=(sensor,), mono_ns=START_NS, unix_ns=0)
    with Recorder(folder / "run.wire", header, VirtualClock(START_NS)) as recorder:
        deliver(plan, recorder, rng)
    assert main(["recover", str(folder / "run.wire"), "-o", str(folder / "run.h5")]) == 0
    capsys.readouterr()
    code = main(["analyse", str(folder / "run.h5"), "--json", "--strict", *more])
    out = capsys.readouterr().out
    return code, json.loads(out) if out else {}


@pytest.mark.parametrize("seed", sampled(range(TRIALS), 4))
def test_a_dropout_moves_no_period_beyond_its_uncertainty(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of random place, number and length: the period is within three u of the true one, or nothing is claimed."""
    rng = np.random.default_rng([seed, 2026])
    plan = planned(rng)
    code, result = analysed(plan, tmp_path, rng, capsys)
    if code:
        assert code in (3, 5), plan
        return
    period = result["estimates"]["period"]
    assert abs(period["value"] - plan.period_s) < 3.0 * period["u"], plan


@pytest.mark.parametrize("ppm", sampled([4000.0, 0.0], 1))
@pytest.mark.parametrize("dropout", [(2.0, 15.0), (-1.0, 13.0), (9.5, 12.0)])
def test_thirteen_of_twenty_seconds_at_once_cost_no_accuracy(
    dropout: tuple[float, float], ppm: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A device with a clock is as well known behind a stall as without one, and the finding says what happened."""
    plain = Plan("line-protocol", 20.0, [], ppm, 0.7431)
    stalled = replace(plain, dropouts=[(*dropout, False)])
    results = []
    for name, plan in (("plain", plain), ("stalled", stalled)):
        (tmp_path / name).mkdir()
        code, result = analysed(plan, tmp_path / name, np.random.default_rng(8), capsys)
        assert code == 0
        results.append(result)
    undisturbed, disturbed = results
    codes = [finding["code"] for finding in disturbed["findings"]]
    assert "late_readings" in codes
    assert not {"late_readings", "clock_refused"} & {finding["code"] for finding in undisturbed["findings"]}
    period, second = undisturbed["estimates"]["period"], disturbed["estimates"]["period"]
    assert abs(second["value"] - plan.period_s) < 3.0 * second["u"]
    assert abs(second["value"] - period["value"]) < 1e-4 * period["value"]
    assert period["u"] <= second["u"] < 5e-5 * period["value"]


@pytest.mark.parametrize(("stated", "refused"), [([], True), (["--clock-ppm", "40000"], False)])
def test_a_correction_beyond_the_clock_is_refused_unless_the_clock_is_said_to_need_it(
    stated: list[str], refused: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three per cent are no resonator's: nothing is corrected and u holds them; ``--clock-ppm`` overrides."""
    plan = Plan("line-protocol", 20.0, [], 30_000.0, 0.7431)
    code, result = analysed(plan, tmp_path, np.random.default_rng(8), capsys, *stated)
    period = result["estimates"]["period"]
    reported = {finding["code"]: finding for finding in result["findings"]}
    assert (code, "clock_refused" in reported) == (0, refused)
    assert abs(period["value"] - plan.period_s) < 3.0 * period["u"]
    if refused:
        assert reported["clock_refused"]["severity"] == "warning"
        assert period["u"] == pytest.approx(0.03 / math.sqrt(3.0) * period["value"], rel=0.01)
    else:
        assert period["u"] < 1e-4 * period["value"]
