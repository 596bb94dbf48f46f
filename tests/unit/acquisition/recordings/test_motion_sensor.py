"""The MotionSensor.vi reader: every variant seen, and every way a file can be bad."""

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.errors import FormatError
from acquisition.recordings.families.motion_sensor import FORMAT
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording
from tests.sampling import sampled
from tests.unit.acquisition.recordings.test_format_traps import codes

TITLE = "Motion Sensor Data File Sep 20, 2018 1:40 PM"
POSITION = "Time (s)\tDistance (cm)\tDist Error (cm)"
VELOCITY = "Time (s)\tVelocity (cm/s)"


def position_rows(count: int = 12, rate: float = 100.0, start: int = 0) -> list[str]:
    """Return rows of a position file, 20.000 cm and up."""
    return [f"{(start + i) / rate:.3f}\t{20 + i / 8:.3f}\t0.239" for i in range(count)]


def read(*lines: str, newline: str = "\n", **options: object) -> Recording:
    """Read a file of these lines, without newline after the last."""
    return FORMAT.read("run.txt", newline.join(lines).encode(), ReadOptions.of(options))


@pytest.mark.parametrize("newline", sampled(["\r\n", "\n", "\r"], 1))
@pytest.mark.parametrize(
    "header",
    [
        [TITLE, POSITION],
        ["Motion Sensor Data File Thu, Oct 07, 2021 9:39 AM", POSITION],
        ["velocity Oct 20, 2022 10:08 AM", POSITION],
        ["run of\tMonday", "second line of a title", POSITION],
        [TITLE],
        [POSITION],
        [],
    ],
)
def test_header_variants(header: list[str], newline: str) -> None:
    """Title, column line, both or neither: the rows are read alike."""
    recording = read(*header, *position_rows(), newline=newline)
    np.testing.assert_allclose(recording.samples.distance, (20 + np.arange(12) / 8) / 100, rtol=1e-15)
    assert not recording.samples.flags.any()
    assert recording.malformed_rows == 0
    assert recording.info.rate_hz == 100.0
    assert recording.info.stated_error_m == 0.00239
    assert codes(recording) - {"unit_assumed"} == {"nominal_clock", "stated_error_is_not_noise"}
    assert ("unit_assumed" in codes(recording)) == (POSITION not in header)
    assert FORMAT.recognises(newline.join([*header, *position_rows()]).encode())


# Velocity alone ---------------------------------------------------------------------------------------------


def velocity_run(count: int = 400, rate: float = 100.0, quantum_cm: float = 0.0043) -> tuple[np.ndarray, list[str]]:
    """Return a position on its lattice, m, and the velocity file's rows."""
    ticks = np.rint((20 + 5 * np.sin(8 * np.arange(count) / rate)) / quantum_cm)
    velocity = np.diff(ticks, prepend=ticks[0]) * quantum_cm * rate
    rows = [f"{i / rate:.3f}\t{v:.3f}" for i, v in enumerate(velocity)]
    rows[0] = "0.000\tNaN"
    return ticks * quantum_cm / 100, rows


@pytest.mark.parametrize("header", [[TITLE, VELOCITY], [VELOCITY], [TITLE], []])
@pytest.mark.parametrize(("rate", "quantum_cm"), [(100.0, 0.0043), (60.0, 0.004256)])
def test_velocity_is_summed_up(header: list[str], rate: float, quantum_cm: float) -> None:
    """Position comes back but for its offset, within the rounding of the print; the file does not show its step."""
    position, rows = velocity_run(rate=rate, quantum_cm=quantum_cm)
    recording = read(*header, *rows)
    assert recording.channel == "velocity"
    assert recording.info.quantum_m is None
    np.testing.assert_allclose(recording.samples.distance, position - position[0], atol=2e-6)
    assert not recording.samples.flags.any()
    assert recording.samples.velocity is not None
    assert np.isnan(recording.samples.velocity[0])
    assert "offset_unknown" in codes(recording)


def test_a_hole_in_velocity_leaves_a_flagged_unknown_offset() -> None:
    """After NaN or lost rows the position hangs on a guess, and says so."""
    position, rows = velocity_run()
    rows[100] = "1.000\tNaN"
    del rows[200:203]
    recording = read(TITLE, VELOCITY, *rows)
    flags = recording.samples.flags
    assert flags[100] == Flag.MISSING
    assert np.isnan(recording.samples.distance[100])
    assert np.flatnonzero(flags & Flag.GAP_BEFORE.value).tolist() == [101, 200]
    (trap,) = (trap for trap in recording.traps if trap.code == "offset_unknown_after_gap")
    assert trap.count == 2
    np.testing.assert_allclose(recording.samples.distance[:100], (position - position[0])[:100], atol=2e-6)
    np.testing.assert_allclose(recording.samples.distance[203:], (position - position[0])[206:], atol=5e-4)


# Position and velocity -----------------------------------------------------------------------------------


def test_a_pair_of_different_runs_is_noticed() -> None:
    """Velocities that are not the differences of the positions are another run's; so are other rates."""
    _, velocity = velocity_run(60)
    v = ("v.txt", "\n".join([VELOCITY, *velocity]).encode())
    wrong = FORMAT.read_pair(("p.txt", "\n".join([POSITION, *position_rows(60)]).encode()), v)
    assert "pair_mismatch" in codes(wrong)
    with pytest.raises(FormatError, match=r"60 Hz.*p\.txt.*100 Hz"):
        FORMAT.read_pair(("p.txt", "\n".join([POSITION, *position_rows(60, 60.0)]).encode()), v)
    with pytest.raises(FormatError, match="times"):
        FORMAT.read_pair(("p.txt", "\n".join([POSITION, *position_rows(60, start=900)]).encode()), v)
