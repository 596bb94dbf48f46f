"""Events come back from a log and from its run file as they were written, whether this version knows them or not."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from acquisition.clock import VirtualClock
from acquisition.events import (
    Continued,
    Dropped,
    Event,
    Lost,
    Noted,
    Reopened,
    Replaced,
    RunEnded,
    StoredEvent,
    TimedOut,
    Triggered,
    Zeroed,
    recorded_events,
)
from acquisition.live.calibration import Calibration
from storage.recorder import Recorder
from storage.recovery.recover import recover
from storage.run_file.reading import open_run
from storage.wire_log.appending import WireLogWriter
from storage.wire_log.records import LogHeader, RecordKind, SensorEntry
from tests.wire import append

HEADER = LogHeader(sensors=(SensorEntry(0, "maxbotix-hr"),), mono_ns=0, unix_ns=0)
PORT = {"port": "COM3", "gap_s": 1.5, "sensor": "identified"}
EVENTS: list[tuple[Event, dict[str, Any]]] = [
    (Lost(port="COM3", why="gone"), {"port": "COM3", "why": "gone"}),
    (Reopened(**PORT), PORT),
    (Replaced(**PORT, channel=1), {**PORT, "channel": 1}),
    (Continued(**PORT, of=0), {**PORT, "of": 0}),
    (TimedOut(after_s=1.0), {"after_s": 1.0}),
    (Dropped(records=2, bytes=10, first_ns=7), {"records": 2, "bytes": 10, "first_ns": 7}),
    (Zeroed(rest_m=0.3, noise_m=0.0), {"rest_m": 0.3, "noise_m": 0.0}),
    (Triggered(threshold_m=0.01, keep_s=0.0), {"threshold_m": 0.01, "keep_s": 0.0}),
    (Noted(text="\ud800 Stoß"), {"text": "\ud800 Stoß"}),
    (RunEnded(by="seconds", failures={"display": 2}), {"by": "seconds", "failures": {"display": 2}}),
    (RunEnded(by="seconds"), {"by": "seconds"}),
]


def events_in_run_file(folder: Path, *payloads: bytes) -> list[StoredEvent]:
    """Return the events of the run file that a log with these events gives."""
    log = WireLogWriter(folder / "run.wire", HEADER)
    append(log, RecordKind.DATA, b"R1000\r", mono_ns=1)
    for number, payload in enumerate(payloads, 2):
        append(log, RecordKind.EVENT, payload, mono_ns=number)
    log.close()
    with open_run(recover(folder / "run.wire").main.path) as run:
        return [event for _, event in recorded_events(run.provenance)]


@pytest.mark.parametrize(("event", "facts"), EVENTS, ids=lambda value: getattr(value, "kind", ""))
def test_an_event_has_its_facts_in_the_run_file_and_its_type_again(
    tmp_path: Path, event: Event, facts: dict[str, Any]
) -> None:
    """From the recorder to the provenance of the run file; facts that are not stated are not written."""
    with Recorder(tmp_path / "run.wire", HEADER, VirtualClock()) as recorder:
        recorder.reads([(0, 1, b"R1000\r")])
        recorder.event(0, 2, event)
    with open_run(recover(tmp_path / "run.wire").main.path) as run:
        (entry,) = run.provenance["events"]
        ((_, stored),) = recorded_events(run.provenance)
    assert (entry["mono_ns"], entry["channel"], entry["kind"], entry["facts"]) == (2, 0, event.kind, facts)
    assert stored.typed == event


@pytest.mark.parametrize(
    "content",
    [
        {"kind": "moved", "facts": {"by": [1, {"of": None}], "kind": "lift"}},
        {"kind": "moved", "facts": {}},
        {"kind": "", "facts": {"\ud800": 1}},
    ],
)
def test_an_event_of_an_unknown_kind_is_kept_verbatim(tmp_path: Path, content: dict[str, Any]) -> None:
    """As a later version may write it."""
    (event,) = events_in_run_file(tmp_path, json.dumps(content).encode("ascii"))
    assert {"kind": event.kind, "facts": event.facts} == content
    assert event.typed is None


def test_facts_that_are_unknown_or_of_another_type_are_kept_and_the_others_are_read(tmp_path: Path) -> None:
    """Of an older, a later or another program; an integer stays an integer."""
    facts = {"port": 5, "why": "gone", "room": "B12", "kind": "cable", "\udc00": [0]}
    payloads = [
        json.dumps({"kind": "lost", "facts": facts}),
        '{"kind": "reopened", "facts": {"gap_s": 3}}',
        '{"kind": "overflow"}',
        '{"kind": "still", "facts": {"rest_m": null, "noise_m": 1' + 400 * "0" + "}}",
    ]
    lost, reopened, overflow, still = events_in_run_file(tmp_path, *(text.encode("ascii") for text in payloads))
    assert (lost.facts, lost.typed) == (facts, Lost(why="gone"))
    assert (json.dumps(reopened.facts), reopened.typed) == ('{"gap_s": 3}', Reopened(gap_s=3.0))
    assert (overflow.facts, overflow.typed) == ({}, Dropped())
    assert (still.facts["noise_m"], still.typed) == (10**400, Zeroed())


@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"[]", b'{"kind": 5}', b'{"facts": {}}', b'{"kind": "lost", "more": 1}', b'{"kind": "lost"'],
)
def test_an_event_that_cannot_be_read_is_kept_with_the_reason(tmp_path: Path, payload: bytes) -> None:
    """Its checksum is right, so another program wrote it."""
    (event,) = events_in_run_file(tmp_path, payload)
    assert event.kind == "unreadable"
    assert event.facts["bytes"] == payload.decode("ascii", "replace")
    assert event.facts["why"].startswith("event")


def test_a_calibration_is_known_with_any_facts(tmp_path: Path) -> None:
    """All numbers of the calibration are in the run file."""
    facts = asdict(Calibration(offset_m=0.1))
    (event,) = events_in_run_file(tmp_path, json.dumps({"kind": "calibration", "facts": facts}).encode("ascii"))
    assert event.facts == facts
    assert event.typed is not None
