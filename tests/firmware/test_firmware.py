"""The rangefinder's firmware, as it runs: times, codes, commands, and what it takes of the processor."""

import re
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from acquisition.decoders.decoder import Identity
from acquisition.decoders.line_protocol import LONGEST_LINE, LineProtocolDecoder
from acquisition.live.firmware import FIRMWARE_VERSION, HEX, MODEL

from .conftest import ELF, Emulate, Emulated

pytestmark = pytest.mark.trials

TICK_US = 0.5
"""What an echo time may be off, us, and a ping."""


def statuses(run: Emulated) -> str:
    """Return the status letters in their order."""
    return b"".join(row[4] for row in run.readings()).decode()


def demand_true_echoes(run: Emulated) -> None:
    """Demand of every reading with an echo that it is as long as ECHO was up, and sent with no gap."""
    rows = run.readings()
    assert [row[0] for row in rows] == list(range(len(rows)))
    first_us = run.pings.up[0] / 16 - rows[0][1]
    for sequence, device_us, echo, _, status in rows:
        # Pings that are left out while ECHO is stuck have no pulse; before them the numbers are the pulses'.
        if status == b"E":
            assert abs(float(echo) - run.pings.echo_ticks[sequence] / 16) <= TICK_US
            assert abs(device_us + first_us - run.pings.up[sequence] / 16) <= 1.0
        else:
            assert echo == b""


def test_counters_wrap_and_the_timer_s_overflows_are_all_counted(emulate: Emulate) -> None:
    """70 s hold 17,000 overflows, and the 32 bits of ticks run over at 268 s: times go on in steps of 100 ms."""
    run = emulate(300.0, say=((0.1, "R10"),))
    device_us = np.array([row[1] for row in run.readings()])
    assert set(np.diff(device_us)[20:]) == {100_000}
    demand_true_echoes(run)


@pytest.mark.parametrize(
    ("trouble", "seen", "least"),
    [({"lost": 0.05}, "ENB", 0.6), ({"lost": 0.05, "retriggers": True}, "EN", 0.85), ({"late": 0.05}, "ENB", 0.8)],
    ids=str,
)
def test_pings_without_an_echo_are_coded(emulate: Emulate, trouble: dict[str, object], seen: str, least: float) -> None:
    """Lost and late ones; a module that takes a new ping meanwhile loses the one sample, a plain one four."""
    run = emulate(10.0, **trouble)
    demand_true_echoes(run)
    assert set(statuses(run)) == set(seen)
    for row, _, _, _, status in run.readings():
        kind = run.pings.kind[row]
        assert (status == b"E") == (kind == "echo"), (row, kind, status)
        assert (status == b"B") == (kind == "ignored"), (row, kind, status)
    assert statuses(run).count("E") >= least * len(run.readings())


def test_a_missing_transducer_is_told_from_a_missing_target(emulate: Emulate) -> None:
    """No answer gives A immediately; no echo is N; the readings go on when it is back."""
    absent = statuses(emulate(3.0, absent="1,2"))
    assert re.fullmatch("E{90,}A{99,101}E{90,}", absent)
    gone = statuses(emulate(3.0, gone="1,2"))
    assert re.fullmatch("E{90,}(NBBB){25,26}E{90,}", gone)


def test_an_echo_line_that_is_stuck_is_told(emulate: Emulate) -> None:
    """B for a quarter of a second, then S, and not one ping more than in that time while it lasts."""
    run = emulate(3.0, stuck="1,2")
    assert re.fullmatch("E{90,}NB{20,30}S{65,80}B{0,2}E{90,}", statuses(run))
    assert len(run.readings()) >= 296


def test_a_ghost_is_scattered_by_pings_at_random_intervals(emulate: Emulate) -> None:
    """The echo of the ping before comes at a fixed time after that; with a spread it no longer stands still."""
    steady = emulate(10.0, ghost=0.1, ghost_us=11_500, amplitude=0.0)
    spread = emulate(10.0, ghost=0.1, ghost_us=11_500, amplitude=0.0, say=((0.1, "J1000"),))
    scatter = []
    for run in (steady, spread):
        demand_true_echoes(run)
        ghosts = [row for row, kind in enumerate(run.pings.kind) if kind == "ghost" and row > 50]
        echoes = {row[0]: float(row[2]) for row in run.readings() if row[2]}
        scatter.append(np.std([echoes[row] for row in ghosts if row in echoes]))
    assert scatter[0] < 1.0
    assert scatter[1] > 100.0
    device_us = np.array([row[1] for row in spread.readings()])[30:]
    assert 9000 <= np.diff(device_us).min() < np.diff(device_us).max() <= 11_000
    assert abs((device_us[-1] - device_us[0]) / (device_us.size - 1) - 10_000) < 3.0


def test_commands_set_rate_gate_spread_and_name_and_are_answered(emulate: Emulate) -> None:
    """Each by a line of what it is now; one that is none by a refusal; nothing else changes."""
    commands = ("?", "R125", "G200,2100", "J500", "Nbench-3")
    commands += ("R9", "R126", "G100,900", "J2001", "Nname that is too long", "hm")
    run = emulate(4.0, say=tuple((0.5 + 0.2 * i, text) for i, text in enumerate(commands)))
    decoder = LineProtocolDecoder()
    identities = []
    for _, line in run.lines:
        decoder.status.identity = None
        decoder.feed(0, line)
        if decoder.status.identity:
            identities.append(decoder.status.identity)
    settings = {"rate_hz": 100, "near_us": 116, "far_us": 25_000, "spread_us": 0, "thermometer": 0}
    expected = [Identity(MODEL, FIRMWARE_VERSION, "", dict(settings))] * 2
    for change in ({"rate_hz": 125}, {"near_us": 200, "far_us": 2100}, {"spread_us": 500}):
        settings |= change
        expected.append(Identity(MODEL, FIRMWARE_VERSION, "", dict(settings)))
    expected.append(Identity(MODEL, FIRMWARE_VERSION, "bench-3", settings))
    assert identities == expected
    assert dict(decoder.faults) == {
        **dict.fromkeys(decoder.faults, 0),
        "refused_command": 6,
        "garbage_bytes": 6 * len("$X1,command*392D\n"),
    }
    assert decoder.status.conditions.keys() == {"too_far"}
    demand_true_echoes(run)


def test_an_echo_outside_the_gate_is_coded_and_has_no_time(emulate: Emulate) -> None:
    """Nearer than the gate is C, farther is F."""
    run = emulate(3.0, say=((1.0, "G2000,2100"),), damping=0.0)
    letters = Counter(statuses(run)[120:])
    assert letters.keys() == {"C", "E", "F"}
    assert min(letters.values()) > 10
    demand_true_echoes(run)


@pytest.mark.parametrize("celsius", [21.3, -5.06, 0.0])
def test_a_thermometer_is_read_while_the_pings_go_on(emulate: Emulate, celsius: float) -> None:
    """A sixteenth of a degree is its step; no ping is late by it, and none has a temperature before it was read."""
    run = emulate(5.0, temperature=celsius)
    texts = [row[3] for row in run.readings()]
    known = [int(text) / 100 for text in texts if text]
    assert texts[0] == b""
    assert texts[-1] != b""
    assert np.abs(np.array(known) - celsius).max() <= 1 / 32 + 0.005
    assert np.abs(np.diff(run.pings.up) - 160_000).max() <= 16
    demand_true_echoes(run)


def test_a_thermometer_that_has_not_measured_is_not_believed(emulate: Emulate) -> None:
    """85 degC is what it says before."""
    assert {row[3] for row in emulate(4.0, temperature=85.0).readings()} == {b""}


def demand_unharmed(run: Emulated, seconds: float) -> None:
    """Demand that the readings went on without a gap, and that it still knows what it is."""
    assert run.all_sent
    rows = run.readings()
    assert [row[0] for row in rows] == list(range(len(rows)))
    last_s = run.lines[-1][0] / 16e6
    assert last_s > seconds - 0.25
    decoder = LineProtocolDecoder()
    for _, line in run.lines:
        decoder.feed(0, line)
    assert decoder.faults["bad_checksum"] == decoder.faults["bad_frame"] == decoder.faults["unknown_record"] == 0
    assert decoder.faults["refused_command"] > 0
    assert decoder.status.identity is not None
    settings = decoder.status.identity.settings
    assert 10 <= settings["rate_hz"] <= 125
    assert 116 <= settings["near_us"] <= settings["far_us"] <= 30_000
    assert run.watchdog == 0
    assert run.ram <= 512


def test_every_line_is_as_long_as_any_other_of_its_kind(emulate: Emulate) -> None:
    """Up to the digits of echo and temperature: a host that compares clocks would take growth for a rate."""
    lines = [line for _, line in emulate(12.0, amplitude=0.0).lines if line.startswith(b"$R1,")]
    assert len({len(line) for line in lines}) == 1
    assert len(lines[0]) < LONGEST_LINE


def test_the_firmware_is_small_and_leaves_the_watchdog_alone(built: Path, emulate: Emulate) -> None:
    """8 KiB of flash, 512 bytes of RAM with the stack; a watchdog would lock up boards with old bootloaders."""
    table = subprocess.run(["avr-size", "-A", built / ELF], capture_output=True, text=True, check=True).stdout
    sizes = {row.split()[0]: int(row.split()[1]) for row in table.splitlines() if row.startswith(".")}
    assert sizes[".text"] + sizes[".data"] <= 8192
    run = emulate(6.0, temperature=20.0, lost=0.02, say=((1.0, "Nbench-3"), (2.0, "G150,9000")))
    assert 0 < run.ram <= 512
    assert run.watchdog == 0


def test_the_hex_that_travels_is_what_the_source_makes(built: Path) -> None:
    """Byte for byte, wherever it is built; `make firmware` brings it up to date."""
    assert (built / "springmass_rangefinder.hex").read_bytes() == HEX.read_bytes()
