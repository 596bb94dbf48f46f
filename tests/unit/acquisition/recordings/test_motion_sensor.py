"""The MotionSensor.vi reader: every variant seen, and every way a file can be bad."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.families.motion_sensor import FORMAT
from acquisition.recordings.questions import Missing
from acquisition.recordings.recording import Recording
from acquisition.recordings.sampling.nominal import find_rate
from acquisition.recordings.sampling.velocity import find_quantum, find_tick, integrate

TITLE = "Motion Sensor Data File Sep 20, 2018 1:40 PM"
POSITION = "Time (s)\tDistance (cm)\tDist Error (cm)"
VELOCITY = "Time (s)\tVelocity (cm/s)"
UNREAD = Flag.MISSING | Flag.MALFORMED


def position_rows(count: int = 12, rate: float = 100.0, start: int = 0) -> list[str]:
    """Return rows of a position file, 20.000 cm and up."""
    return [f"{(start + i) / rate:.3f}\t{20 + i / 8:.3f}\t0.239" for i in range(count)]


def read(*lines: str, newline: str = "\n", **options: object) -> Recording:
    """Read a file of these lines, without newline after the last."""
    return FORMAT.read("run.txt", newline.join(lines).encode(), **options)  # type: ignore[arg-type]


def codes(recording: Recording) -> set[str]:
    """Return what was seen on the way."""
    return {trap.code for trap in recording.traps}


def check_position(recording: Recording, count: int = 12) -> None:
    """Demand the rows of :func:`position_rows`, all sound."""
    np.testing.assert_allclose(recording.samples.distance, (20 + np.arange(count) / 8) / 100, rtol=1e-15)
    assert not recording.samples.flags.any()
    assert recording.malformed_rows == 0


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
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
    check_position(recording)
    assert recording.info.rate_hz == 100.0
    assert recording.info.stated_error_m == 0.00239
    assert codes(recording) - {"unit_assumed"} == {"nominal_clock", "stated_error_is_not_noise"}
    assert ("unit_assumed" in codes(recording)) == (POSITION not in header)
    assert FORMAT.recognises(newline.join([*header, *position_rows()]).encode())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
def test_encodings(encoding: str) -> None:
    """Byte order marks, UTF-16 without one and 8-bit titles are read alike."""
    title = "Motion Sensor Data File 20 °C"
    recording = FORMAT.read("run.txt", "\r\n".join([title, POSITION, *position_rows()]).encode(encoding))
    check_position(recording)
    assert recording.title == title


def test_decimal_commas() -> None:
    """A comma is a decimal mark, in all cells or in some."""
    rows = [row.replace(".", ",") for row in position_rows()]
    check_position(read(TITLE, POSITION, *rows))
    check_position(read(TITLE, POSITION, *position_rows()[:5], *rows[5:]))


@pytest.mark.parametrize("delimiter", [";", ",", "  "])
def test_other_delimiters(delimiter: str) -> None:
    """A spreadsheet may have put something else for the tabs."""
    check_position(read(POSITION, *(row.replace("\t", delimiter) for row in position_rows())))


def test_zeros_at_the_end_of_decimals_may_be_gone() -> None:
    """A spreadsheet prints 20.5 for 20.500; that is no cut number."""
    rows = [f"{i / 100:g}\t{20 + i / 8:g}\t0.239" for i in range(12)]
    check_position(read(POSITION, *rows, ""))


@pytest.mark.parametrize("rate", [60.0, 100.0, 125.0])
@pytest.mark.parametrize("start", [0, 504])
def test_times_are_put_back_on_their_grid(rate: float, start: int) -> None:
    """The rate is inferred, the rounding of times undone, and a cropped start kept."""
    recording = read(TITLE, POSITION, *position_rows(rate=rate, start=start))
    assert recording.info.rate_hz == rate
    assert recording.info.clock == "nominal"
    assert recording.samples.t.tolist() == [(start + i) / rate for i in range(12)]


def test_a_rate_that_few_rows_leave_open_is_said_to_be_assumed() -> None:
    """Two rows 17 ms apart are likely 60 Hz, which is said."""
    recording = read(POSITION, *position_rows(2, 60.0))
    assert recording.info.rate_hz == 60.0
    assert "rate_assumed" in codes(recording)


def test_jittered_times_stand_as_printed() -> None:
    """Times on no grid are measured ones: they are kept."""
    rng = np.random.default_rng(3)
    t = np.cumsum(0.05 + 0.02 * rng.random(40))
    rows = [f"{x:.3f}\t20.000\t0.239" for x in t]
    recording = read(POSITION, *rows)
    assert recording.info.clock == "device"
    np.testing.assert_array_equal(recording.samples.t, np.round(t, 3))


def test_a_given_unit_must_not_contradict_the_column_line() -> None:
    """A unit is for files that state none."""
    with pytest.raises(FormatError, match=r'cm.*"mm"'):
        read(POSITION, *position_rows(), unit="mm")
    assert read(*position_rows(), unit="mm").samples.distance[0] == 0.02


def test_a_channel_the_file_lacks_is_an_error() -> None:
    """Position cannot be read as velocity."""
    with pytest.raises(FormatError, match=r'distance.*"velocity"'):
        read(POSITION, *position_rows(), channel="velocity")


def test_simulated_data_say_so() -> None:
    """A title or a file name that speaks of simulation makes the kind simulated."""
    data = "\n".join([TITLE, POSITION, *position_rows()]).encode()
    assert FORMAT.read("/bench/damped_simulated_position.txt", data).info.kind == "simulated"
    assert FORMAT.read("/simulated/run.txt", data).info.kind == "replay"
    assert read("Motion Sensor Data File (simulated)", POSITION, *position_rows()).info.kind == "simulated"
    assert read(TITLE, POSITION, *position_rows()).info.kind == "replay"


def test_a_first_row_that_is_damaged_is_no_title() -> None:
    """Without a header, a line that begins with a number is a row."""
    rows = position_rows()
    rows[0] = "0.000\t20.0x0\t0.239"
    recording = read(*rows)
    assert (recording.title, recording.samples.flags[0]) == ("", UNREAD)


def test_an_error_column_that_varies_is_no_stated_error() -> None:
    """Only a constant is the same figure for all samples."""
    rows = [f"{i / 100:.3f}\t{20 + i / 8:.3f}\t0.{230 + i}" for i in range(12)]
    assert "stated_error_is_not_noise" not in codes(read(POSITION, *rows))


def test_a_last_row_of_0_03_tab_0_is_not_zero() -> None:
    """The example that readers elsewhere get wrong."""
    recording = read(POSITION, "0.010\t20.000\t0.239", "0.020\t20.100\t0.239", "0.03\t0.")
    assert recording.samples.flags.tolist() == [0, 0, UNREAD]


def test_a_damaged_row_is_kept_as_a_missing_sample() -> None:
    """Its time follows from its place on the grid."""
    rows = position_rows()
    rows[4] = "0.0#0\t2x.500\t0.239"
    recording = read(TITLE, POSITION, *rows)
    assert recording.samples.t.tolist() == [i / 100 for i in range(12)]
    assert np.flatnonzero(recording.samples.flags).tolist() == [4]
    assert recording.samples.flags[4] == UNREAD
    assert recording.malformed_rows == 1
    (trap,) = (trap for trap in recording.traps if trap.code == "malformed_rows")
    assert (trap.count, trap.line) == (1, 7)


def test_a_cut_number_in_the_middle_is_no_value() -> None:
    """A row with fewer decimals than all others lost some."""
    rows = position_rows()
    rows[6] = "0.060\t20.7\t0.239"
    recording = read(TITLE, POSITION, *rows)
    assert recording.samples.flags[6] == UNREAD


def test_a_single_time_that_shoots_ahead_is_the_wrong_one() -> None:
    """One damaged digit must not condemn all that follows it."""
    rows = position_rows()
    rows[3] = "9.030\t20.375\t0.239"
    flags = read(TITLE, POSITION, *rows).samples.flags
    assert np.flatnonzero(flags & Flag.NON_MONOTONIC_TIME.value).tolist() == [3]


def test_a_constant_distance_is_read() -> None:
    """Whether a run oscillates is for the analysis to say."""
    recording = read(POSITION, *(f"{i / 100:.3f}\t20.000\t0.239" for i in range(9)))
    assert set(recording.samples.distance) == {0.2}


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (TITLE, 1),
        (f"{TITLE}\n{POSITION}\n", 2),
        (f"{POSITION}\n0.000\t20.000\t0.239", None),
        (f"{POSITION}\n0.000\tNaN\t0.239\n0.010\tNaN\t0.239\n", 2),
        (f"{POSITION}\n0.000\t20.000\n0.010\t20.000\n", 2),
        (f"{POSITION}\nhello\nworld\n", 2),
    ],
)
def test_files_without_a_run_are_refused(data: str, line: int | None) -> None:
    """Header only, one row, all NaN: one clear line each, with the line of the file where there is one."""
    with pytest.raises(FormatError) as caught:
        FORMAT.read("run.txt", data.encode())
    assert caught.value.line == line
    assert "\n" not in str(caught.value)


def test_two_columns_under_a_title_are_not_guessed() -> None:
    """Distance or velocity: the user says which."""
    rows = [f"{i / 100:.3f}\t{20 + i:.3f}" for i in range(5)]
    with pytest.raises(NeedsAnswer) as caught:
        read(TITLE, *rows)
    assert caught.value.question.missing == (Missing.CHANNEL,)
    recording = read(TITLE, *rows, channel="position")
    assert recording.samples.distance.tolist() == [0.20, 0.21, 0.22, 0.23, 0.24]


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
def test_velocity_is_summed_up_on_its_lattice(header: list[str], rate: float, quantum_cm: float) -> None:
    """Position comes back but for its offset; the rounding of the print does not add up."""
    position, rows = velocity_run(rate=rate, quantum_cm=quantum_cm)
    recording = read(*header, *rows)
    assert recording.channel == "velocity"
    assert recording.info.quantum_m == pytest.approx(quantum_cm / 100, rel=1e-5)
    np.testing.assert_allclose(recording.samples.distance, position - position[0], atol=2e-7)
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
    np.testing.assert_allclose(recording.samples.distance[:100], (position - position[0])[:100], atol=2e-7)
    np.testing.assert_allclose(recording.samples.distance[203:], (position - position[0])[206:], atol=5e-4)


def test_a_tick_is_found_only_where_there_is_one() -> None:
    """Values without a lattice have no tick, and clusters of a fine lattice give the coarse one."""
    rng = np.random.default_rng(5)
    assert find_tick(np.round(rng.normal(0, 40, 5000), 3), 0.001) is None
    j = rng.integers(-200, 200, 3000)
    k = 10 * j + rng.integers(0, 2, 3000)
    tick = find_tick(np.round(0.043 * k, 3), 0.001)
    assert tick == pytest.approx(0.043, rel=1e-6)
    assert find_quantum(0.043 * k, tick) == pytest.approx(0.43, rel=1e-6)


def test_integrate_starts_at_zero_whether_or_not_the_first_velocity_is_known() -> None:
    """A cropped file has a first velocity, which leads nowhere."""
    v = np.array([5.0, 1.0, 2.0])
    np.testing.assert_allclose(integrate(v, np.arange(3), 10.0, None, 0.0).position, [0, 0.1, 0.3])
    v[0] = np.nan
    np.testing.assert_allclose(integrate(v, np.arange(3), 10.0, None, 0.0).position, [0, 0.1, 0.3])


# Position and velocity -----------------------------------------------------------------------------------


def test_a_pair_is_joined_by_time_not_by_row() -> None:
    """Windows differ: where one file has no row, its quantity is missing."""
    position, velocity = velocity_run(60)
    rows = [f"{i / 100:.3f}\t{x * 100:.3f}\t0.239" for i, x in enumerate(position)]
    recording = FORMAT.read_pair(
        ("p.txt", "\n".join([POSITION, *rows[10:50]]).encode()),
        ("v.txt", "\n".join([VELOCITY, *velocity[5:55]]).encode()),
    )
    samples = recording.samples
    assert samples.velocity is not None
    assert samples.t.tolist() == [i / 100 for i in range(5, 55)]
    np.testing.assert_allclose(samples.distance[5:45], position[10:50], atol=5.01e-6)
    assert np.isnan(samples.distance[:5]).all()
    assert np.isnan(samples.distance[45:]).all()
    assert samples.flags.tolist() == [1] * 5 + [0] * 40 + [1] * 5
    assert np.isfinite(samples.velocity).all()
    assert [original.name for original in recording.originals] == ["p.txt", "v.txt"]
    assert recording.info.quantum_m == pytest.approx(4.3e-5, rel=1e-5)
    assert "pair_mismatch" not in codes(recording)


def test_a_pair_is_told_apart_by_content() -> None:
    """The order in which the two files are named does not matter."""
    position, velocity = velocity_run(60)
    p = (
        "p.txt",
        "\n".join([POSITION, *(f"{i / 100:.3f}\t{x * 100:.3f}\t0.239" for i, x in enumerate(position))]).encode(),
    )
    v = ("v.txt", "\n".join([VELOCITY, *velocity]).encode())
    first, second = FORMAT.read_pair(p, v), FORMAT.read_pair(v, p)
    np.testing.assert_array_equal(first.samples.distance, second.samples.distance)
    with pytest.raises(FormatError, match="velocity"):
        FORMAT.read_pair(v, v)


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


@pytest.mark.parametrize("rate", [10.0, 25.0, 60.0, 100.0, 125.0, 73.0])
def test_rates_are_found_in_rounded_times(rate: float) -> None:
    """Long enough, any whole rate is found from milliseconds, with repeats and holes in the times."""
    index = np.delete(np.arange(300), [50, 51, 120])
    t = np.round(np.sort(np.append(index, [30, 200])) / rate, 3)
    result = find_rate(t, 0.001)
    assert result is not None
    assert result.rate_hz == rate
    assert result.certain


def test_times_closer_than_their_last_digit_give_no_certain_rate() -> None:
    """Where a damaged file's times differ by less than most of their cells print, no rate is certain."""
    result = find_rate(np.array([0.0, 0.02, 0.21]), 1.0)
    assert result is not None
    assert not result.certain
