"""Dialects met in public: each file opens with what its dialect says, or asks in one line for what it leaves out."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing
from pipeline.analyse import analyse
from pipeline.track import UNUSABLE
from springmass.cli import main
from springmass.runs.tracks import to_track
from tests.sampling import sampled

DEG = np.pi / 180


@dataclass(frozen=True)
class Row:
    """One file: rows, times and values as counted by grep, head and tail; ``asks`` are the options it must ask for."""

    start: str
    family: str
    channel: str
    samples: int
    rate_hz: float
    t: tuple[float, float]
    ends: tuple[float, float]
    quantity: str = "length"
    asks: tuple[str, ...] = ()
    given: dict[str, Any] = field(default_factory=dict)


NAN = float("nan")
UNIT, CHANNEL, RATE, TIME_UNIT = Missing.UNIT, Missing.CHANNEL, Missing.RATE_HZ, Missing.TIME_UNIT


def say(channel: str = "", unit: str = "", **more: Any) -> dict[str, Any]:
    """Return answers, as the reader takes them."""
    return {**({"channel": channel} if channel else {}), **({"unit": unit} if unit else {}), **more}


TABLE = [
    Row(
        *("anglelog", "table", "Angle1", 2054, 37.93, (0.008788585662841797, 55.58119797706604), (NAN, -0.62182428783)),
        *("angle", (CHANNEL, UNIT), say("Angle1", "rad")),
    ),
    Row("capstone", "capstone", "Position", 300, 40, (0, 7.475), (0, -0.2454), "length", (Missing.RUN,), say(run="1")),
    Row(
        *("cassycsv", "table", "Weg &b_A1", 789, 10, (0, 78.80078), (0.42, 0.3)),
        *("angle", (CHANNEL,), say("Weg &b_A1")),
    ),
    Row("chartrec", "table", "Position", 2450, 1, (0, 2450.017), (0.062, 0.06)),
    Row(
        *("coupled", "table", "x_rojo", 633, 30, (0, 21.058692499742083), (0.573, 0.592)),
        *("length", (CHANNEL, UNIT), say("x_rojo", "mm")),
    ),
    Row(
        *("csvnames", "table", "y", 1000, 999, (0, 1), (0.012244149389694231, -0.0069972303705410615)),
        *("length", (UNIT,), say(unit="m")),
    ),
    Row("datcsv", "table", "Channel 1", 1000, 1000, (0, 0.999), (1.909113020050780538, 0.8965729794617469), "voltage"),
    Row(
        *("ecp", "table", "Encoder 1 Pos", 677, 112.95, (0, 5.985), (0, -0.002)),
        *("length", (CHANNEL, UNIT), say("Encoder 1 Pos", "mm")),
    ),
    Row("fluids", "table", "Position", 1000, 4, (0.024, 249.774), (0.007041, NAN)),
    Row("ga-csv", "table", "CH1", 60, 5e8, (-6e-8, 5.8e-8), (-2.58, 2.5), "voltage", (CHANNEL,), say("CH1")),
    Row(
        *("heidelberg", "table", "column 2", 1842, 40, (0.025, 46.082), (0.00838, -0.03136)),
        *("length", (CHANNEL, UNIT), say("column 2", "cm")),
    ),
    Row(
        *("lvm__spikelucky__test.lvm", "lvm", "Measurement (Gleichspannung)", 251, 100, (0, 2.5), (12.806113, 7.96688)),
        *("voltage", (CHANNEL, RATE), say("Measurement (Gleichspannung)", rate_hz=100.0)),
    ),
    Row(
        *("lvm__spikelucky__test2", "table", "column 2", 718, 100, (0, 7.17), (4.482024, -0.003006)),
        *("voltage", (CHANNEL, RATE, UNIT), say("column 2", "V", rate_hz=100.0)),
    ),
    Row(
        *("lvm__spikelucky__hyd", "lvm", "Lead", 1900, 100, (0, 18.99), (1.392038, 1.021796)),
        *("voltage", (CHANNEL, RATE), say("Lead", rate_hz=100.0)),
    ),
    Row(
        *("microbit__ES2Spring2019-ComputinginEngineering__L13", "table", "column 1", 501, 49, (0.019, 10.205)),
        *((1344, 1104), "acceleration", (CHANNEL, TIME_UNIT, UNIT), say("column 1", "m/s2", time_unit="ms")),
    ),
    Row(
        *("microbit__ES2Spring2019-ComputinginEngineering__data", "table", "column 2", 415, 42.5, (0.01, 9.81)),
        *((-2040, -1532), "acceleration", (CHANNEL, TIME_UNIT, UNIT), say("column 2", "m/s2", time_unit="ms")),
    ),
    Row(
        *("moku", "table", "Input A", 1196, 100, (0, 11.95), (1.4646310123, -0.72630122579)),
        *("voltage", (CHANNEL,), say("Input A")),
    ),
    Row(
        *(
            "pendser",
            "table",
            "peaks",
            449,
            22.45,
            (-9.95967999761, 9.99892000239),
            (-5.060461956521739, -5.0153985507),
        ),
        *("voltage", (UNIT,), say(unit="V")),
    ),
    Row("phyphox__tomas", "phyphox", "Altitude", 61, 0.95, (-0.5446145, 62.1287695), (0, 0.2750143392)),
    Row(
        *("picoscope", "table", "Kanal A", 50, 381.47, (-0.05295434967, 0.07549620955), (2.986236, -2.670217)),
        *("voltage", (CHANNEL,), say("Kanal A")),
    ),
    Row(
        *("plasduino", "table", "Pos A", 1830, 19.73, (0.026, 92.740), (0.501, 0.5)),
        *("length", (CHANNEL, UNIT), say("Pos A", "mm")),
    ),
    Row(
        *("plasduino", "table", "Pos B", 1830, 19.73, (0.051, 92.765), (0.298, 0.452)),
        *("length", (CHANNEL, UNIT), say("Pos B", "mm")),
    ),
    Row(
        *("qpd", "table", "leftMinusRight", 2500, 50, (0, 49.98), (-0.003122677793726325, -0.003122677793726325)),
        *("voltage", (CHANNEL, UNIT), say("leftMinusRight", "V")),
    ),
    Row(
        *("runhead", "table", "LR_Signal", 7497, 125, (0.004820, 60.001596), (-0.003043, -0.002956)),
        *("voltage", (CHANNEL, UNIT), say("LR_Signal", "V")),
    ),
    Row("scope", "table", "1", 2000, 40000, (-0.025, 0.024975), (9724.24598694, 9724.24598694), "voltage"),
    Row(
        *("tdisp", "table", "column 2", 7343, 9.58, (1.6412410736083984, 767.7529900074005), (0.3708, 0.1515)),
        *("length", (Missing.RUN, UNIT), say(unit="cm", run="2")),
    ),
    Row("terr", "table", "θ", 9625, 30, (0, 319.91), (-0.156, 0.001), "angle", (UNIT,), say(unit="rad")),
    Row("tnames", "table", "theta", 2376, 30, (0, 79.229), (0.229270, 0.002382), "angle"),
    Row(
        *("torsione", "table", "Pendolo", 4015, 50, (0, 80.28), (0.008, 0.006)),
        *("angle", (CHANNEL, UNIT), say("Pendolo", "rad")),
    ),
    Row(
        *("tracker", "table", "amp", 4005, 30, (0, 133.52333333333334), (-0.29042339407279855, 0.08850613208159334)),
        *("angle", (UNIT,), say(unit="rad")),
    ),
    Row(
        *("trkerr", "table", "y", 1999, 30, (0, 66.64422), (19.94714 * DEG, 2.141127 * DEG)),
        *("angle", (UNIT,), say(unit="deg")),
    ),
    Row("tunit", "table", "θ", 3027, 30, (0, 100.8667), (-18.56635 * DEG, -0.8148416 * DEG), "angle"),
    Row("vernier", "table", "versnelling", 600, 99.83, (0, 6), (0, 0), "acceleration"),
    Row("waveforms", "table", "Channel 1", 2000, 100, (0, 19.99), (2.622803, 1.641071), "voltage"),
    Row("lab__", "cassy", "s s", 600, 10, (0, 59.901), (0, 0), "length", (CHANNEL,), say("s s")),
    Row(
        *("lab__", "cassy", "Spannung U_A1", 600, 10, (0, 59.901), (0.807, 0.8115)),
        *("voltage", (CHANNEL,), say("Spannung U_A1")),
    ),
    Row("labx", "cassy", "Weg s_A1", 1335, 5, (0, 266.81870875), (0.232, -0.004)),
    Row(
        *("cmbl", "logger-pro", "X", 71, 60, (0.135, 1.30166666667), (0, 1156)),
        *("length", (CHANNEL, UNIT), say("X", "m")),
    ),
    Row(
        *("trk__", "tracker", "x", 114, 12, (16.501723237597916, 25.919373368146555)),
        *(
            ((1268.0536912751645 - 978.5) / 598.7622693748787, (1138.468694746403 - 978.5) / 598.7622693748787),
            "length",
            (CHANNEL,),
            say("x"),
        ),
    ),
    Row(
        *("phyphox__Ckenz0", "zip", "Acceleration x", 7504, 411.6, (3.352406400e-2, 18.26407438)),
        *((3.759722710e-1, 3.233301640e-1), "acceleration", (CHANNEL,), say("Acceleration x")),
    ),
    Row(
        *(
            "zip__",
            "workbook",
            "Acceleration x",
            1449,
            99.6,
            (0.02255779165716376, 14.55188329165685),
            (0.0245489501953125, 0.0211061096191406),
        ),
        *("acceleration", (CHANNEL,), say("Acceleration x")),
    ),
    Row(
        *(
            "phyphoxfile",
            "workbook",
            "Rotation x",
            484,
            48.42,
            (0.044677716, 10.020003966),
            (0.1078176349401474, 0.2420551627874374),
        ),
        *("angular_velocity", (Missing.RUN, CHANNEL), say("Rotation x", run="Raw Data")),
    ),
    Row("xyerr", "table", "Y", 152, 11.9, (0, 12.668), (0.5768678112, 0.647375818), "length", (UNIT,), say(unit="m")),
    Row("xy_", "table", "y", 3501, 10, (0, 350), (0, -8.98898e-05), "length", (UNIT,), say(unit="m")),
]


def only(recordings: Path, start: str) -> Path:
    """Return the one file under wild/ of that name."""
    (path,) = (each for each in (recordings / "wild").iterdir() if each.name.startswith(start))
    return path


every = pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row.start}:{row.channel}")


@every
def test_a_dialect_is_read_as_it_was_counted(recordings: Path, row: Row) -> None:
    """Family, channel, rate, number of samples, quantity, first and last time and value."""
    recording = open_recording(only(recordings, row.start), **row.given)
    samples = recording.samples
    read = (recording.format, recording.channel, len(samples), samples.quantity)
    assert read == (row.family, row.channel, row.samples, row.quantity)
    span = row.t[1] - row.t[0]
    assert (row.samples - 1) / span == pytest.approx(row.rate_hz, rel=0.05)
    # Nominal times are put on their grid, within the rounding of what is printed.
    np.testing.assert_allclose((samples.t[0], samples.t[-1]), row.t, atol=max(1.1e-2 / row.rate_hz, 1e-12), rtol=1e-9)
    np.testing.assert_allclose((samples.distance[0], samples.distance[-1]), row.ends, rtol=1e-9, atol=1e-12)


@every
def test_what_a_dialect_leaves_out_is_asked_in_one_line(recordings: Path, row: Row) -> None:
    """Only what is needed, all of it together, in one line; what needs nothing opens."""
    path = only(recordings, row.start)
    if not row.asks:
        assert len(open_recording(path).samples) == row.samples
        return
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)
    assert set(caught.value.question.missing) == set(row.asks)


def test_a_workbook_of_results_is_no_recording(recordings: Path) -> None:
    """Row numbers are no times: a table of results by hand is answered as such, unless a rate is stated."""
    with pytest.raises(FormatError, match="not a recording"):
        open_recording(only(recordings, "xlsx"))
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(only(recordings, "xlsx"), rate_hz=1.0)
    assert caught.value.question.missing == (CHANNEL, UNIT)


def test_every_wild_file_has_a_row(recordings: Path) -> None:
    """A file that nobody counted is not held to its dialect."""
    names = {path.name for path in (recordings / "wild").iterdir()} - {"ORIGIN.md"}
    listed = {name for name in names if any(name.startswith(row.start) for row in TABLE) or name.startswith("xlsx")}
    assert listed == names


# Of the rows above, by file and channel: those that oscillate, and those in which nothing does, or nothing for long.
OSCILLATE = (
    *("cassycsv", "chartrec", "coupled", "datcsv", "heidelberg", "microbit__ES2Spring2019-ComputinginEngineering__L13"),
    *(
        "microbit__ES2Spring2019-ComputinginEngineering__data",
        "moku",
        "picoscope",
        "Pos B",
        "qpd",
        "runhead",
        "tracker",
    ),
    *("trkerr", "tunit", "labx", "trk__", "xyerr", "terr", "tnames", "scope", "tdisp"),
)
STROKES = ("ecp",)
BEAT = ("anglelog", "torsione", "waveforms", "xy_", "csvnames")
"""Those whose one sinusoid of the whole record says little: set going, held or driven for a while."""
DO_NOT = (
    *("capstone", "fluids", "ga-csv", "lvm__spikelucky__test.lvm", "lvm__spikelucky__test2"),
    *("lvm__spikelucky__hyd", "pendser", "phyphox__tomas", "vernier", "lab__", "cmbl"),
    *("phyphox__Ckenz0", "zip__", "phyphoxfile"),
)


def of(names: tuple[str, ...]) -> list[Row]:
    """Return the rows of these files or channels; of a file named alone all its rows."""
    return [row for row in TABLE if row.start in names or row.channel in names]


def independent_period(t: np.ndarray, y: np.ndarray) -> float:
    """Return the period by scipy alone: a robust fit of a damped sinusoid on a straight line, from the spectrum's peak.

    The whole record is one fit; nothing is cut into windows, and no law is chosen.
    """
    from scipy.optimize import least_squares
    from scipy.signal import detrend

    known = np.isfinite(t) & np.isfinite(y)
    t, y = t[known] - t[known][0], y[known]
    y = (y - np.median(y)) / np.std(y)
    span, step = float(t[-1]), float(np.median(np.diff(t)))
    grid = np.arange(int(span / step)) * step
    power = np.abs(np.fft.rfft(detrend(np.interp(grid, t, y)) * np.hanning(grid.size), 8 * grid.size))
    rates = np.fft.rfftfreq(8 * grid.size, step)
    omega = 2.0 * np.pi * rates[np.argmax(np.where(rates > 1.5 / span, power, 0.0))]
    waves = np.stack([np.ones_like(t), t / span, np.cos(omega * t), np.sin(omega * t)], axis=1)
    start = np.linalg.lstsq(waves, y, rcond=None)[0]

    def left(x: np.ndarray) -> np.ndarray:
        fall = np.exp(-np.clip(x[5] * t / span, -5.0, 50.0))
        angle = (omega + x[4] / span) * t
        return x[0] + x[1] * t / span + fall * (x[2] * np.cos(angle) + x[3] * np.sin(angle)) - y

    ends = [least_squares(left, [*start, 0.0, rate], loss="soft_l1", f_scale=0.1) for rate in (0.0, 1.0, 4.0)]
    best = min(ends, key=lambda end: float(end.cost))
    return float(2.0 * np.pi / (omega + best.x[4] / span))


@pytest.mark.parametrize("row", of(OSCILLATE), ids=lambda row: f"{row.start}:{row.channel}")
def test_what_oscillates_has_the_period_of_an_independent_fit(recordings: Path, row: Row) -> None:
    """Of the same rows: within three standard uncertainties and, as pendulums follow their amplitude, 0.02 %."""
    recording = open_recording(only(recordings, row.start), **row.given)
    found = analyse(to_track(recording.samples, recording.info))
    period, used = found.estimates["period"], (found.flags & UNUSABLE) == 0
    expected = independent_period(recording.samples.t[used], recording.samples.distance[used])
    assert abs(period.value - expected) < 3.0 * period.u + 2e-4 * expected
    assert period.u < 5e-3 * period.value


def crossing_period(t: np.ndarray, y: np.ndarray, near: float) -> float:
    """Return the period by scipy's filter alone: the median slope of the times at which the signal rises through zero.

    ``near`` says which band is passed, from half its frequency to 1.6 times, and how many turns lie between.
    """
    from scipy.signal import butter, detrend, sosfiltfilt
    from scipy.stats import theilslopes

    known = np.isfinite(t) & np.isfinite(y)
    t, y = t[known], y[known]
    step = float(np.median(np.diff(t)))
    grid = np.arange(t[0], t[-1], step)
    band = butter(2, np.array([0.5, 1.6]) * 2.0 * step / near, "band", output="sos")
    passed = sosfiltfilt(band, detrend(np.interp(grid, t, y)))
    at = np.flatnonzero((passed[:-1] < 0.0) & (passed[1:] >= 0.0))
    crossed = grid[at] - passed[at] * step / (passed[at + 1] - passed[at])
    return float(theilslopes(crossed, np.round((crossed - crossed[0]) / near))[0])


@pytest.mark.parametrize("row", of(BEAT), ids=lambda row: f"{row.start}:{row.channel}")
def test_what_oscillates_unevenly_has_the_period_of_its_crossings(recordings: Path, row: Row) -> None:
    """Within three standard uncertainties and 0.02 %; what was read in volts, as no bob oscillates at the mains'."""
    given = row.given | ({"unit": "V"} if row.start == "csvnames" else {})
    recording = open_recording(only(recordings, row.start), **given)
    found = analyse(to_track(recording.samples, recording.info))
    period, used = found.estimates["period"], (found.flags & UNUSABLE) == 0
    expected = crossing_period(recording.samples.t[used], recording.samples.distance[used], period.value)
    assert abs(period.value - expected) < 3.0 * period.u + 2e-4 * expected
    assert period.u < 1.5e-2 * period.value


@pytest.mark.parametrize("row", of(STROKES), ids=lambda row: f"{row.start}:{row.channel}")
def test_of_two_strokes_the_last_gives_the_period(recordings: Path, row: Row) -> None:
    """A carriage is driven forth and back and swings after each; its crossings of the last rest say the period."""
    recording = open_recording(only(recordings, row.start), **row.given)
    found = analyse(to_track(recording.samples, recording.info))
    t, y = recording.samples.t, recording.samples.distance - np.median(recording.samples.distance[-100:])
    last = np.flatnonzero((t[:-1] > 3.05) & (t[:-1] < 3.65) & (y[1:] * y[:-1] < 0.0))
    crossed = t[last] - y[last] * (t[last + 1] - t[last]) / (y[last + 1] - y[last])
    period = found.estimates["period"]
    assert abs(period.value - 2.0 * float(np.mean(np.diff(crossed)))) < 2.0 * period.u
    assert {"handled", "short_record"} <= {each.code for each in found.findings}


def test_every_row_is_held_to_a_period_or_to_none() -> None:
    """No recording whose motion nobody judged."""
    listed = {*OSCILLATE, *BEAT, *STROKES, *DO_NOT, "Pos A"}
    assert [row.start for row in TABLE if not {row.start, row.channel} & listed] == []


@pytest.mark.parametrize("row", of(DO_NOT), ids=lambda row: f"{row.start}:{row.channel}")
def test_what_does_not_oscillate_has_no_period(recordings: Path, row: Row) -> None:
    """A ride, a drop, a relaxation, a stroke on a rubber band, a chaotic pendulum, a telephone that lies.

    Nor what nobody could state one of: runs one upon the other, a telephone that a hand turns to and fro.
    """
    recording = open_recording(only(recordings, row.start), **row.given)
    assert "period" not in analyse(to_track(recording.samples, recording.info)).estimates


MOVE = ("tdisp", "phyphoxfile", "plasduino", *OSCILLATE, *BEAT, *STROKES)
"""Files in which something oscillates."""


@pytest.mark.parametrize("start", sampled(dict.fromkeys(each for each in MOVE if each != "Pos B"), 5))
def test_who_types_what_the_message_says_gets_a_period(
    recordings: Path, start: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two commands at most: the plain one, and the one that its question ends in."""
    code = main(["analyse", str(only(recordings, start)), "--json"])
    said = capsys.readouterr()
    if code == 3:
        _, *words = shlex.split(said.err[said.err.index("? springmass ") + 2 :])
        code = main(words)
        said = capsys.readouterr()
    assert code == 0
    assert "period" in json.loads(said.out.splitlines()[0])["estimates"]
