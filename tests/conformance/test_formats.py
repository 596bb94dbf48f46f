"""The rules that every format of recordings keeps; a new one joins by adding its cases to ``CASES``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.block import Flag, concatenate
from acquisition.errors import FormatError
from acquisition.formats.base import HEAD_BYTES, Format
from acquisition.recording import Recording
from acquisition.registry import formats, get_format

RATE_HZ = 100.0
T = np.arange(300) / RATE_HZ
DISTANCE = np.round(0.20 + 0.05 * np.sin(7.9 * T), 5)


@dataclass(frozen=True)
class Case:
    """A file of one format with known content.

    Parameters
    ----------
    format : str
        Name in the registry.
    label : str
        What is special about it.
    build : callable
        Bytes of a file that holds ``T`` (s) and ``DISTANCE`` (m).
    quantum_m : float
        Step of distance that the reader must report, m.
    offset_known : bool
        Whether the file says where zero is.
    """

    format: str
    label: str
    build: Callable[[], bytes]
    quantum_m: float
    offset_known: bool = True


def motion_position(newline: str = "\r\n", header: int = 2, error: bool = True) -> bytes:
    """Write the MotionSensor.vi position file."""
    columns = "Time (s)\tDistance (cm)" + ("\tDist Error (cm)" if error else "")
    lines = ["Motion Sensor Data File Sep 20, 2018 1:40 PM", columns][2 - header :]
    tail = "\t0.239" if error else ""
    return newline.join([*lines, *(f"{t:.3f}\t{x * 100:.3f}{tail}" for t, x in zip(T, DISTANCE, strict=True))]).encode()


def motion_velocity() -> bytes:
    """Write the MotionSensor.vi velocity file."""
    v = np.diff(DISTANCE, prepend=np.nan) * RATE_HZ * 100
    rows = [f"{t:.3f}\t{x:.3f}".replace("nan", "NaN") for t, x in zip(T, v, strict=True)]
    return "\r\n".join(["velocity Oct 20, 2022", "Time (s)\tVelocity (cm/s)", *rows]).encode()


CASES = [
    Case("motion-sensor", "position", motion_position, 1e-5),
    Case("motion-sensor", "position-LF", lambda: motion_position("\n"), 1e-5),
    Case("motion-sensor", "position-no-header", lambda: motion_position(header=0), 1e-5),
    Case("motion-sensor", "position-no-error", lambda: motion_position(error=False), 1e-5),
    Case("motion-sensor", "position-UTF-16", lambda: motion_position().decode().encode("utf-16"), 1e-5),
    Case("motion-sensor", "velocity", motion_velocity, 1e-5, offset_known=False),
]

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.format}:{case.label}")


def read(case: Case, data: bytes | None = None) -> Recording:
    """Read a case, or other bytes as its format."""
    return get_format(case.format).read("run.dat", case.build() if data is None else data)


def test_every_format_of_the_registry_has_a_case() -> None:
    """A format without a case is not held to the rules."""
    assert {each.name for each in formats()} == {case.format for case in CASES}


@every_case
def test_it_is_recognised_by_its_own_format_alone(case: Case) -> None:
    """From the head of the file, whatever its name."""
    head = case.build()[:HEAD_BYTES]
    assert [each.name for each in formats() if each.recognises(head)] == [case.format]


@pytest.mark.parametrize("each", formats(), ids=lambda each: each.name)
@pytest.mark.parametrize("head", [b"", b"\0", b"\xff\xfe", bytes(range(256)) * 8, b"hello\nworld\n", b"\n" * 99])
def test_what_is_no_recording_is_not_recognised(each: Format, head: bytes) -> None:
    """Recognising never raises and never claims noise."""
    assert each.recognises(head) is False


@every_case
def test_what_was_written_is_read(case: Case) -> None:
    """Times and distances come back, to the rounding of the file."""
    samples = read(case).samples
    np.testing.assert_array_equal(samples.t, T)
    distance = samples.distance - (0 if case.offset_known else samples.distance[0] - DISTANCE[0])
    np.testing.assert_allclose(distance, DISTANCE, atol=1e-9)
    assert not samples.flags.any()


@every_case
def test_rate_quantum_clock_and_kind_are_recorded(case: Case) -> None:
    """What is known of the source travels with it."""
    info = read(case).info
    assert (info.rate_hz, info.kind, info.clock, info.name) == (RATE_HZ, "replay", "nominal", "run.dat")
    assert info.quantum_m == pytest.approx(case.quantum_m, rel=1e-4)


@every_case
def test_a_nominal_clock_is_said(case: Case) -> None:
    """Row numbers over a rate are not measured times."""
    assert "nominal_clock" in {trap.code for trap in read(case).traps}


@every_case
def test_the_file_comes_back_bit_for_bit(case: Case) -> None:
    """The original bytes are kept."""
    data = case.build()
    (original,) = read(case, data).originals
    assert (original.name, original.data) == ("run.dat", data)


@every_case
@pytest.mark.parametrize("size", [1, 7, 300, 9999])
def test_blocks_are_the_whole_cut_up(case: Case, size: int) -> None:
    """Blocks of any size join to the same samples."""
    recording = read(case)
    joined = concatenate(recording.blocks(size))
    assert joined.first == 0
    for name in ("t", "distance", "flags"):
        assert getattr(joined, name).tobytes() == getattr(recording.samples, name).tobytes()


@every_case
def test_samples_have_the_types_of_a_block(case: Case) -> None:
    """Arrays of one length, in SI units, as the block says."""
    samples = read(case).samples
    assert (samples.first, samples.t.dtype, samples.distance.dtype) == (0, np.float64, np.float64)
    assert (samples.flags.dtype, samples.host_ns) == (np.uint8, None)
    assert samples.t.size == samples.distance.size == samples.flags.size


@every_case
@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_a_truncated_last_row_is_flagged_and_counted(case: Case, cut: int) -> None:
    """A number that stopped midway is no value."""
    width = 2 if case.label.endswith("UTF-16") else 1
    recording = read(case, case.build()[: -cut * width])
    assert recording.malformed_rows == 1
    assert "truncated_row" in {trap.code for trap in recording.traps}
    assert recording.samples.flags[-1] & Flag.MISSING
    assert np.isnan(recording.samples.distance[-1])
    assert len(recording.samples) == T.size


@every_case
def test_half_a_file_is_read_or_refused_in_one_line(case: Case) -> None:
    """Wherever a file stops, nothing but a FormatError comes out, and no sound sample is wrong."""
    data = case.build()
    refusals: list[str] = []
    for size in range(0, len(data), 97):
        try:
            recording = read(case, data[:size])
        except FormatError as error:
            refusals.append(str(error))
            continue
        sound = recording.samples.flags == 0
        shift = 0 if case.offset_known else recording.samples.distance[0] - DISTANCE[0]
        found = recording.samples.distance[sound] - shift
        np.testing.assert_allclose(found, DISTANCE[: sound.size][sound], atol=1e-9)
    assert refusals
    assert not any("\n" in refusal for refusal in refusals)


@every_case
def test_a_rate_that_contradicts_the_file_is_refused(case: Case) -> None:
    """The user cannot overrule what the times say."""
    with pytest.raises(FormatError, match="37"):
        get_format(case.format).read("run.dat", case.build(), rate_hz=37.0)
