"""The rules for a format of recordings, with files of known content that an example writes."""

import codecs
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acquisition.block import Flag
from acquisition.errors import FormatError
from acquisition.recordings.identify import formats
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Format, Recording
from acquisition.recordings.tables.text import HEAD_BYTES
from pipeline.track import F8
from springmass.testing.demands import demand

EXAMPLE_RATE_HZ = 100.0
EXAMPLE_TIMES_S = np.arange(300) / EXAMPLE_RATE_HZ
DISTANCE = np.round(0.20 + 0.05 * np.sin(7.9 * EXAMPLE_TIMES_S), 5)
_NOISE = (b"", b"\0", b"\xff\xfe", bytes(range(256)) * 8, b"hello\nworld\n", b"\n" * 99)


@dataclass(frozen=True)
class File:
    """A file of a format with known content.

    Parameters
    ----------
    write : callable
        Takes times (n,) in s and distances (n,) in m, NaN where there is none, and returns the bytes of a file.
    answers : mapping
        What the file leaves open, by name: the fields of :class:`springmass.extend.ReadOptions`.
    quantum_m : float or None
        Step of the distances that the reader reports, m; None: not checked.
    offset_known : bool
        Whether the file says where zero is.
    text : bool
        Whether it is rows of text, of which the last may be cut off.
    """

    write: Callable[[Any, Any], bytes]
    answers: Mapping[str, Any] = field(default_factory=dict)
    quantum_m: float | None = None
    offset_known: bool = True
    text: bool = True


@dataclass(frozen=True)
class Case:
    """A format with a file."""

    format: Format
    file: File

    def read(self, data: bytes, **answers: Any) -> Recording:
        """Read bytes, with the answers of the file."""
        return self.format.read("run.dat", data, ReadOptions.of({**self.file.answers, **answers}))

    def written(self, t: F8 = EXAMPLE_TIMES_S, x: F8 = DISTANCE) -> Recording:
        """Read a file of these times and distances."""
        return self.read(self.file.write(t, x))

    @property
    def whole(self) -> bytes:
        """The bytes of a sound file."""
        return self.file.write(EXAMPLE_TIMES_S, DISTANCE)

    def demand_distances(self, recording: Recording, x: F8 = DISTANCE) -> None:
        """Demand the distances where no flag is set, up to a constant if the file does not know it."""
        sound = recording.samples.flags == 0
        distances, expected = recording.samples.distance[sound], x[: sound.size][sound]
        shift = 0.0 if self.file.offset_known or not distances.size else distances[0] - expected[0]
        demand(np.allclose(distances - shift, expected, rtol=0, atol=1e-9), "return the distances of the file in m")


def _demand_trap(recording: Recording, code: str, flag: Flag | None = None, first: int = 0, stop: int = 0) -> None:
    codes = sorted({trap.code for trap in recording.traps})
    demand(code in codes, f"report the trap {code}, got {', '.join(codes) or 'none'}")
    if flag is not None:
        rows = np.flatnonzero(recording.samples.flags & flag.value).tolist()
        expected = f"set the flag {flag.name} in rows {first} to {stop - 1} alone, got {rows[:3]} ..."
        demand(rows == list(range(first, stop)), expected)


def recognised_by_itself_alone(case: Case) -> None:
    """The head of a file shows its format, whatever its name; no other format claims it, and noise is none."""
    head = case.whole[:HEAD_BYTES]
    demand(case.format.recognises(head) is True, "recognise the first 8192 bytes of its own file")
    others = [each.name for each in formats() if each.recognises(head) and each.name not in (case.format.name, "table")]
    demand(not others, f"write files that no other format recognises, not as {', '.join(others)} do")
    for noise in _NOISE:
        demand(case.format.recognises(noise) is False, f"return False from recognises({noise[:20]!r})")


def written_is_read(case: Case) -> None:
    """Samples, facts and the original come back."""
    data = case.whole
    recording = case.read(data)
    samples, info, quantum_m = recording.samples, recording.info, case.file.quantum_m
    demand(
        np.array_equal(samples.t, EXAMPLE_TIMES_S),
        "return the times of the file in s; row numbers over a rate are exact",
    )
    demand(not samples.flags.any(), "set no flag in a sound file")
    case.demand_distances(recording)
    facts, expected = (
        (info.rate_hz, info.kind, info.clock, info.name),
        (EXAMPLE_RATE_HZ, "replay", "nominal", "run.dat"),
    )
    demand(facts == expected, f"record rate_hz, kind, clock and name as {expected}, got {facts}")
    same = quantum_m is None or (info.quantum_m is not None and np.isclose(info.quantum_m, quantum_m, rtol=1e-4))
    demand(same, f"report the step of the distances, {quantum_m} m, as quantum_m, got {info.quantum_m}")
    kept = [(each.name, each.data) for each in recording.originals]
    demand(kept == [("run.dat", data)], "keep the bytes of the file in originals")


def half_a_file(case: Case) -> None:
    """Wherever a file stops it is read or refused in one line, and no sound sample is wrong."""
    data, refusals = case.whole, 0
    for size in range(0, len(data), max(1, len(data) // 24)):
        try:
            recording = case.read(data[:size])
        except FormatError as error:
            demand("\n" not in str(error), f"refuse a file in one line, got {str(error)!r:.80}")
            refusals += 1
            continue
        case.demand_distances(recording)
    demand(refusals, "raise FormatError for an empty file")


def faults_of_text(case: Case) -> None:
    """A number that stopped midway, a remark between rows and zero bytes at the end are counted and said."""
    if not case.file.text:
        return
    wide = case.whole.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = case.whole.decode("utf-16" if wide else "utf-8-sig").rstrip("\r\n")
    newline = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(newline)
    remark = newline.join([*lines[:-40], "here I touched it", *lines[-40:]])
    for faulty, code in ((text[:-1], "truncated_row"), (text[:-3], "truncated_row"), (remark, "malformed_rows")):
        recording = case.read(faulty.encode("utf-16" if wide else "utf-8"))
        demand(recording.malformed_rows == 1, f"count one malformed row, got {recording.malformed_rows}")
        _demand_trap(recording, code)
        demand(
            np.count_nonzero(recording.samples.flags == 0) >= EXAMPLE_TIMES_S.size - 2,
            "keep the rows around a faulty one",
        )
        if code == "truncated_row":
            _demand_trap(recording, code, Flag.MISSING, EXAMPLE_TIMES_S.size - 1, EXAMPLE_TIMES_S.size)
            case.demand_distances(recording)
    recording = case.read(case.whole + bytes(4096))
    demand(len(recording.samples) == EXAMPLE_TIMES_S.size, "leave out the zero bytes of an interrupted writer")
    _demand_trap(recording, "zero_filled_tail")


def rate_must_not_contradict(case: Case) -> None:
    """The user cannot overrule what the times say; the rate that they have changes nothing."""
    same = np.array_equal(case.read(case.whole, rate_hz=EXAMPLE_RATE_HZ).samples.t, EXAMPLE_TIMES_S)
    demand(same, f"accept rate_hz={EXAMPLE_RATE_HZ:g}, which the file has")
    try:
        case.read(case.whole, rate_hz=37.0)
    except FormatError:
        return
    demand(False, "raise FormatError for a rate_hz that contradicts the file")


def odd_times(case: Case) -> None:
    """Times that repeat, run back or leave a gap are flagged, nothing is dropped, and uneven times stand."""
    if case.file.write(np.append(EXAMPLE_TIMES_S[:-1], 5.0), DISTANCE) == case.whole:
        return  # the rows have no times
    t, kept = EXAMPLE_TIMES_S.copy(), np.delete(np.arange(EXAMPLE_TIMES_S.size), np.s_[140:150])
    t[50], t[120] = t[49], t[100]
    recording = case.written(t)
    demand(len(recording.samples) == EXAMPLE_TIMES_S.size, "drop no row whose time is odd")
    _demand_trap(recording, "duplicate_time", Flag.DUPLICATE_TIME, 50, 51)
    _demand_trap(recording, "non_monotonic_time", Flag.NON_MONOTONIC_TIME, 120, 121)
    _demand_trap(case.written(EXAMPLE_TIMES_S[kept], DISTANCE[kept]), "missing_samples", Flag.GAP_BEFORE, 140, 141)
    uneven: F8 = np.cumsum(np.random.default_rng(5).integers(5, 9, EXAMPLE_TIMES_S.size)) / EXAMPLE_RATE_HZ
    same = np.allclose(np.diff(case.written(uneven).samples.t), np.diff(uneven), rtol=0, atol=6e-7)
    demand(same, "keep measured times as they are")


def odd_distances(case: Case) -> None:
    """NaN and zeros that fill the end are missing samples, a lost target is a false echo, and steps are known."""
    x, offset_known = DISTANCE.copy(), case.file.offset_known
    x[60:80] = np.nan
    recording = case.written(x=x)
    _demand_trap(recording, "missing_samples", Flag.MISSING, 60, 80 if offset_known else 81)
    if not offset_known:
        return
    case.demand_distances(recording, x)
    if recording.samples.quantity != "length":
        return
    x = np.where(np.arange(EXAMPLE_TIMES_S.size) < 280, DISTANCE, 0.0)  # no rangefinder reads exactly 0 m twenty times
    _demand_trap(case.written(x=x), "zero_filled_tail", Flag.MISSING, 280, 300)
    x = DISTANCE.copy()
    x[200:230] = np.concatenate((np.linspace(3.6, 8.1, 10), np.full(20, 8.1)))
    _demand_trap(case.written(x=x), "lost_target", Flag.FALSE_ECHO, 200, 230)
    if case.file.quantum_m is not None:
        quantum_m = case.written(x=np.round(DISTANCE, 2)).info.quantum_m
        demand(
            quantum_m is not None and np.isclose(quantum_m, 0.01),
            f"report a step of 0.01 m as quantum_m, got {quantum_m}",
        )


RULES = (
    recognised_by_itself_alone, written_is_read, half_a_file, faults_of_text, rate_must_not_contradict, odd_times,
    odd_distances,
)  # fmt: skip
