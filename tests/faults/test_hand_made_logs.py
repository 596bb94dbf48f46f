"""Wire logs that nobody recorded, behind right checksums: a run file with true values, or one line of refusal.

The logs are written here byte by byte, from the page on the wire log, with no code of the product.
"""

from __future__ import annotations

import binascii
import json
import math
import os
import struct
import zlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from springmass.cli import main
from storage.run_file.reading import open_run

LOGS = 1000 if os.environ.get("SPRINGMASS_TRIALS") else 200
SECONDS = 10
HEADER, DATA, MARK, EVENT, END = 1, 2, 3, 4, 5
WORDS = """
    null true -1 0 1e999 -1e308 NaN Infinity 5e-324 0.5 9223372036854775807 18446744073709551616 99999999999999999999.5
    "" "x" "\\u0000" "\\ud800" "\\u001b[31m" "../../etc/passwd" "us100" "text-lines" "nan" [] {} ["a"] {"a":NaN}
    {"a":{"b":[1e999]}} {"column":[]} {"separator":5} {"offset_m":"1"} {"scale":0} {"scale":1e300}
    {"speed_of_sound_m_per_s":1e999} {"kind":[1]}
"""
STRANGE = [*WORDS.split(), "1" + "0" * 400, "9" * 5000, "[" * 50 + "]" * 50, "[" * 9000 + "]" * 9000]
STAMPS = [-(2**63), -1, 0, 1, 2**31, 2**53, 2**62 - 1, 2**62, 2**62 + 1, 2**63 - 1]
KEYS = [
    *["log", "mono_ns", "unix_ns", "kind", "scene", "title", "version", "start_utc", "sensors", "other"],
    *["channel", "family", "port", "baud", "rate_hz", "options", "calibration", "clock_ppm", "else"],
]
CALIBRATION = {"speed_of_sound_m_per_s": 344.0, "scale": 1.0, "offset_m": 0.0, "u_scale": 0.0, "u_offset_m": 0.0}


@dataclass
class HandMade:
    """A log being made, and what a reader may make of it."""

    log: int = 77
    sequence: int = 0
    data: bytearray = field(default_factory=bytearray)
    echoes: list[float] = field(default_factory=list)

    def record(self, kind: int, payload: bytes, stamp: int, channel: int = 0, parts: int = 0) -> None:
        """Append a record with a right checksum."""
        head = struct.pack(
            "<2sHIqIBBH", b"\xf5\xa9", len(payload), self.sequence % 2**32, stamp, self.log, kind, channel, parts
        )
        self.data += head + struct.pack("<I", zlib.crc32(head + payload)) + payload
        self.sequence += 1

    def reading(self, rng: np.random.Generator, number: int, stamp: int, channel: int) -> None:
        """Append a read with a line of the line protocol."""
        echo = round(float(rng.uniform(500, 9000)) * 4) / 4
        body = f"R1,{number},{number * 10_000 % 2**32},{echo:.2f},2000,E".encode()
        self.record(DATA, b"$%s*%04X\n" % (body, binascii.crc_hqx(body, 0xFFFF)), stamp, channel)
        self.echoes.append(echo)


def header_text(rng: np.random.Generator, changes: int) -> str:
    """Return a header with some values replaced by strange ones, keys left out and keys added."""
    calibration = dict(CALIBRATION, scale=float(rng.choice([1.0, 1.01])), offset_m=float(rng.choice([0.0, 0.1])))
    sensor = {
        "channel": "0",
        "family": '"line-protocol"',
        "port": '"COM3"',
        "baud": "115200",
        "rate_hz": "100.0",
        "options": "{}",
        "calibration": json.dumps(calibration),
    }
    top = {
        "log": "1",
        "mono_ns": "0",
        "unix_ns": "1600000000000000000",
        "start_utc": '"2020-09-13T12:26:40+00:00"',
        "kind": '"live"',
        "scene": "null",
        "title": '"a run"',
        "version": '"0.1.0"',
    }
    for key in rng.choice(KEYS, changes, replace=False).tolist():
        table = sensor if key in KEYS[10:] else top
        if rng.random() < 0.1:
            table.pop(key, None)
        else:
            table[key] = str(rng.choice(STRANGE))
    if rng.random() < 0.1:
        key = str(rng.choice(list(CALIBRATION)))
        sensor["calibration"] = f'{{"{key}":{rng.choice(STRANGE)}}}'
    sensors = ",".join([json_table(sensor)] * int(rng.choice([1] * 18 + [2, 0])))
    return json_table({"sensors": f"[{sensors}]", **top})


def json_table(values: dict[str, str]) -> str:
    """Return a JSON object of values that are JSON already."""
    return "{" + ",".join(f'"{key}":{value}' for key, value in values.items()) + "}"


def event_text(rng: np.random.Generator) -> str:
    """Return an event, more or less."""
    kinds = ["lost", "reopened", "timeout", "overflow", "calibration", "trigger", "ended", "refused", "still"]
    facts = str(rng.choice(STRANGE))
    if rng.random() < 0.5:
        names = ["scale", "offset_m", "speed_of_sound_m_per_s", "gap_s", "records", "bytes", "first_ns", "why"]
        facts = json_table({str(rng.choice(names)): str(rng.choice(STRANGE))})
    kind = str(rng.choice(STRANGE)) if rng.random() < 0.2 else f'"{rng.choice(kinds)}"'
    return str(rng.choice(STRANGE)) if rng.random() < 0.1 else json_table({"kind": kind, "facts": facts})


def made(rng: np.random.Generator) -> HandMade:
    """Return a hand-made log."""
    log = HandMade()
    log.sequence = int(rng.choice([0, 0, 0, 0, 2**32 - 5, 2**31]))
    log.record(HEADER, header_text(rng, int(rng.choice([0, 0, 0, 0, 1, 1, 2, 4]))).encode(), int(rng.choice([0, 5])))
    stamp, odd = 1_000_000_000, rng.random(4) < [0.3, 0.5, 0.2, 0.2]
    for number in range(int(rng.choice([0, 3, 30, 200]))):
        stamp += 10_000_000
        at = int(rng.choice(STAMPS)) if odd[0] and rng.random() < 0.05 else stamp
        if odd[1] and rng.random() < 0.05:
            log.record(EVENT, event_text(rng).encode("ascii"), at)
        if odd[2] and rng.random() < 0.05:
            log.record(MARK, rng.bytes(int(rng.choice([0, 1, 40, 60_000]))), at)
        if odd[3] and rng.random() < 0.1:
            kind, channel, parts = int(rng.integers(0, 8)), int(rng.integers(0, 256)), int(rng.integers(0, 5))
            log.record(kind, rng.bytes(int(rng.integers(0, 300))), at, channel, parts)
        log.reading(rng, number * int(rng.choice([1, 1, 1, 40])), at, 0)
    if rng.random() < 0.7:
        log.record(END, str(rng.choice(STRANGE)).encode(), stamp)
    return log


def speed_scale_offset(path: Path) -> tuple[float, float, float]:
    """Return the calibration that a run file says it holds."""
    with open_run(path) as run:
        numbers = {**CALIBRATION, **run.provenance["sensor"]["calibration"]}
    return numbers["speed_of_sound_m_per_s"], numbers["scale"], numbers["offset_m"]


@pytest.mark.parametrize(
    "logs", [range(30), pytest.param(range(30, LOGS), marks=pytest.mark.trials)], ids=["few", "many"]
)
def test_a_hand_made_log_gets_an_answer(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    answer_within: Callable[[int], AbstractContextManager[None]],
    logs: range,
) -> None:
    """Recovery of any log ends within ten seconds: true values in a file that verifies, or one line and no file."""
    answers = {0: 0, 3: 0}
    for number in logs:
        log = made(np.random.default_rng([14, number]))
        path, out = tmp_path / "run.wire", tmp_path / "run.h5"
        path.write_bytes(log.data)
        with answer_within(SECONDS):
            code = main(["recover", str(path), "-o", str(out)])
        output = capsys.readouterr().err
        assert code in answers, (number, output[-600:])
        answers[code] += 1
        if code == 0 and out.exists():
            with open_run(out) as run:
                run.verify()
                result = run.samples()
                assert run.originals()[0].data == bytes(log.data)
            speed, scale, offset = speed_scale_offset(out)
            assert 100 < speed < 2000
            assert 0 < scale < 1e4
            expected = np.sort([scale * 0.5e-6 * speed * echo + offset for echo in log.echoes])
            known = result.distance[np.isfinite(result.distance)]
            nearest = expected[np.searchsorted(expected, known - 1e-9).clip(0, max(expected.size - 1, 0))]
            assert np.allclose(known, nearest, rtol=1e-12, atol=1e-12), number
            assert np.isfinite(result.t).all()
            assert all(math.isfinite(gap["length_s"]) for gap in run.provenance["decoding"]["gaps"])
            out.unlink()
        elif code != 0:
            assert output.startswith(f"springmass: {path}: "), output[:300]
            assert output.count("\n") == 1, output[:600]
            assert len(output) < 1000, output[:1200]
            assert not out.exists()
    assert min(answers.values()) > len(logs) // 10, answers
    print(f"hand-made logs: {len(logs)}, {answers[0]} recovered, {answers[3]} refused")
