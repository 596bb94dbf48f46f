"""Numbers, times and blocks in the forms that programs, locales and instruments write: a file in, samples out."""

import datetime
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Flag
from acquisition.errors import FormatError, NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording

N = 60
T = np.arange(N) / 20
X = np.round(5.0 * np.cos(6.0 * T), 3)  # cm


def read(tmp_path: Path, text: str, **answers: str | float) -> Recording:
    """Read a text as a file."""
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8")
    return open_recording(path, ReadOptions.of(answers))


def table(times: Sequence[str], values: Sequence[str], mark: str = ";", head: str = "Time (s);Position (cm)") -> str:
    """Write two columns."""
    return "\n".join([head.replace(";", mark), *(f"{t}{mark}{x}" for t, x in zip(times, values, strict=True)), ""])


def holds(recording: Recording, t: np.ndarray = T, x: np.ndarray = X) -> None:
    """Check times, and values in cm."""
    np.testing.assert_allclose(recording.samples.t, t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.samples.distance, x / 100, rtol=0, atol=1e-9)


# Numbers

FORMS = {
    "en dash": lambda x: f"{x:.3f}".replace("-", "–"),
    "no-break space": lambda x: f"\xa0{x:.3f}",
    "thin space behind": lambda x: f"{x:.3f}\u2009",
    "sign behind": lambda x: f"{-x:.3f}-" if x < 0 else f"{x:.3f}",
    "minus sign in the exponent": lambda x: f"{x:.6E}".replace("-", "−"),
    "exponents of Fortran": lambda x: f"{x:.6E}".replace("E", "Q" if x < 0 else "D"),
    "powers of ten": lambda x: f"{x:.6E}".replace("E", "×10^").replace("-", "−"),
}


@pytest.mark.parametrize("mark", [";", "\t"])
@pytest.mark.parametrize("form", FORMS)
def test_numbers_in_rare_forms_are_read(tmp_path: Path, form: str, mark: str) -> None:
    """The random tables draw the usual ones. The digits are unambiguous, so no row is lost and nothing is asked."""
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], [FORMS[form](x) for x in X], mark))
    holds(recording)
    assert not recording.malformed_rows


@pytest.mark.parametrize("head", ["Time (s);Position (cm)", "Time;Position\n(s);(cm)\n"])
@pytest.mark.parametrize(
    "word", ["∞", "-∞", "OL", "OVER", "---", "#N/A", "inf", "Over range", "9.9E37", "-9.91E+37", "1.99999E+101"]
)
def test_an_overload_is_a_missing_sample_wherever_it_stands(tmp_path: Path, word: str, head: str) -> None:
    """No row of numbers is preamble, even if the swing begins beyond the range."""
    gone = (np.arange(N) < 7) | (np.arange(N) % 9 < 2)
    cells = [word if lost else f"{x:.3f}" for x, lost in zip(X, gone, strict=True)]
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], cells, head=head))
    holds(recording, x=np.where(gone, np.nan, X))
    assert recording.info.quantum_m is not None
    assert recording.info.quantum_m < 1e-4


def test_a_word_of_a_kind_below_belongs_to_the_rows(tmp_path: Path) -> None:
    """An instrument's own word for a lost value does not end the table at its top."""
    cells = ["NO TARGET" if row in (0, 1, 30) else f"{x:.3f}" for row, x in enumerate(X)]
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], cells))
    assert len(recording.samples) == N
    assert np.isnan(recording.samples.distance[[0, 1, 30]]).all()


def test_whole_numbers_among_three_decimals(tmp_path: Path) -> None:
    """26.000 next to 27 is no thousand; 1.000 next to 950 may be one."""
    values = 26.5 + np.round(0.4 * np.cos(6.0 * T), 3)
    cells = ["27" if row == 20 else f"{x:.3f}" for row, x in enumerate(values)]
    millis = [str(round(1000 * t)) for t in T]
    recording = read(tmp_path, table(millis, cells, head="Time (ms);Position (cm)"))
    holds(recording, x=np.where(np.arange(N) == 20, 27.0, values))
    thousands = [f"{x:.0f}" if x < 1000 else f"{x / 1000:.3f}" for x in 1000 + 300 * np.cos(6.0 * T)]
    with pytest.raises(FormatError, match="thousands"):
        read(tmp_path, table(millis, thousands, head="Time (ms);Position (mm)"))


def test_numbers_that_are_all_in_brackets_are_not_negative(tmp_path: Path) -> None:
    """Brackets mean a sign only next to numbers without brackets."""
    with pytest.raises(FormatError):
        read(tmp_path, table([f"{t:.2f}" for t in T], [f"({x + 9:.3f})" for x in X], head="a;b"), rate_hz=20.0)


# Times

BEGUN = datetime.datetime(2025, 4, 17, 16, 59, 59)
MOMENTS = [BEGUN + datetime.timedelta(seconds=t) for t in T.tolist()]


def stamps(pattern: str) -> list[str]:
    """Return clock times; ``{ms}`` stands for three digits of milliseconds, ``{h}`` for an hour without a zero."""
    return [
        each.strftime(pattern.replace("{ms}", f"{each.microsecond // 1000:03d}").replace("{h}", f"{each.hour % 12}"))
        for each in MOMENTS
    ]


STAMPS = {
    "MATLAB": "%d-%b-%Y %H:%M:%S.{ms}",
    "English": "Apr %d, %Y {h}:%M:%S.{ms} PM",
    "ctime": "%a Apr %d %H:%M:%S.{ms} %Y",
    "Spanish": "{h}:%M:%S.{ms} p. m.",
    "Spanish date": "17 de abril de 2025 %H:%M:%S.{ms}",
    "German": "17. April 2025, %H:%M:%S,{ms} Uhr",
    "French": "jeu. 17 avr. 2025 %H:%M:%S,{ms}",
    "Russian": "17 апр. 2025 г., %H:%M:%S.{ms}",
    "Turkish": "17 Nis 2025 %H:%M:%S.{ms}",
    "Greek": "{h}:%M:%S.{ms} μ.μ.",
    "Chinese": "2025年4月17日 下午{h}:%M:%S.{ms}",
    "Korean": "오후 {h}:%M:%S.{ms}",
    "Finnish": "17.4.2025 %H.%M.%S,{ms}",
    "compact ISO": "%Y%m%dT%H%M%S.{ms}Z",
    "Apache": "17/Apr/2025:%H:%M:%S.{ms} +0200",
    "minutes of the hour": "%M:%S.{ms}",
    "twelve hours": "{h}:%M:%S.{ms}",
    "day before month": "17/04/25 %H:%M:%S.{ms}",
}


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("form", STAMPS)
def test_clock_times_are_counted_from_the_first(tmp_path: Path, form: str, order: int) -> None:
    """In every language, over a full hour, and also newest first."""
    times = [f'"{each}"' for each in stamps(STAMPS[form])][::order]
    holds(read(tmp_path, table(times, [f"{x:.3f}" for x in X][::order], head="Time;Position (cm)")))


DURATIONS = {
    "Python": lambda t: f"0:00:{9 + t:09.6f}",
    "ISO": lambda t: f"PT{9 + t:.2f}S",
    "milliseconds": lambda t: f"{1000 * (9 + t):.0f} ms",
    "parts": lambda t: f"0 min {9 + t:.2f} s",
}


@pytest.mark.parametrize("form", DURATIONS)
def test_durations_with_units_are_times(tmp_path: Path, form: str) -> None:
    """They are not counted from the first."""
    times = [DURATIONS[form](t) for t in T]
    if form == "Python":
        holds(read(tmp_path, table(times, [f"{x:.3f}" for x in X], head="Time;Position (cm)")))
    else:
        holds(read(tmp_path, table(times, [f"{x:.3f}" for x in X], head="Time;Position (cm)")), T + 9)


LONG = np.arange(6000) / 20
COUNTERS = {
    "16 bits": (np.round(1000 * LONG) % 65536, "ms"),
    "16 bits with a sign": ((np.round(1000 * LONG) + 32768) % 65536 - 32768, "ms"),
    "32 bits": ((np.round(1e6 * LONG) + 4.2e9) % 2**32, "us"),
    "32 bits with a sign": ((np.round(1e6 * LONG) + 2.1e9 + 2**31) % 2**32 - 2**31, "us"),
    "24 bits": (np.round(1e6 * LONG) % 2**24, "us"),
    "31 bits": ((np.round(1000 * LONG) + 2147400000) % 2**31, "ms"),
    "seconds of the minute": ((LONG + 17.0) % 60, "s"),
    "seconds of the hour": ((LONG + 3590.0) % 3600, "s"),
}


@pytest.mark.parametrize("counter", COUNTERS)
def test_a_counter_that_wraps_goes_on(tmp_path: Path, counter: str) -> None:
    """All rows are one recording, and the wrap is noted."""
    t, unit = COUNTERS[counter]
    values = [f"{x:.3f}" for x in 5.0 * np.cos(6.0 * LONG)]
    cells = [f"{each:.2f}" if unit == "s" else f"{each:.0f}" for each in t]
    recording = read(tmp_path, table(cells, values, head=f"time ({unit});Position (cm)"))
    np.testing.assert_allclose(np.diff(recording.samples.t), 0.05, atol=1e-6)
    assert not recording.samples.flags.any()
    assert [each for each in recording.traps if each.code == "times_mended"]


@pytest.mark.parametrize("first", [0, 593])
@pytest.mark.parametrize("form", ["{s}.{ms}", "17:0:{s}.{ms}", "17:00:{s:02d}:{ms}"])
def test_milliseconds_without_zeros_are_whole_numbers(tmp_path: Path, form: str, first: int) -> None:
    """12.40 is 12.040 s if the digits behind the point never begin with zero."""
    millis = first + np.arange(3000) * 10
    times = [form.format(s=each // 1000, ms=each % 1000) for each in millis.tolist()]
    recording = read(tmp_path, table(times, [f"{x:.3f}" for x in np.cos(0.05 * millis)], head="time;Position (cm)"))
    np.testing.assert_allclose(np.diff(recording.samples.t), 0.01, atol=1e-9)


def test_three_rows_out_of_place_are_sorted(tmp_path: Path) -> None:
    """A row that arrived late takes its place; a time that is wrong stays flagged."""
    order = np.arange(N)
    order[[10, 11, 30, 31, 32]] = [11, 10, 32, 30, 31]
    holds(read(tmp_path, table([f"{t:.2f}" for t in T[order]], [f"{x:.3f}" for x in X[order]])))
    wrong = T.copy()
    wrong[20] = 0.35
    recording = read(tmp_path, table([f"{t:.2f}" for t in wrong], [f"{x:.3f}" for x in X]))
    assert np.flatnonzero(recording.samples.flags & Flag.NON_MONOTONIC_TIME.value).tolist() == [20]


@pytest.mark.parametrize("parts", [2, 5, 12])
@pytest.mark.parametrize("again", ["", "Time (s);Position (cm)\n"])
def test_a_clock_that_starts_again_begins_another_run(tmp_path: Path, parts: int, again: str) -> None:
    """Rows are never joined across a step back, however many there are, with or without headings in between."""
    one = table([f"{t:.2f}" for t in T], [f"{x:.3f}" for x in X])
    text = one + (again + one.split("\n", 1)[1]) * (parts - 1)
    with pytest.raises(NeedsAnswer) as asked:
        read(tmp_path, text)
    (need,) = asked.value.question.needs
    assert need.choices == tuple(f"Part {number}" for number in range(1, parts + 1))
    for run in need.choices[:2]:
        recording = read(tmp_path, text, run=run)
        holds(recording)
        assert not recording.malformed_rows


@pytest.mark.parametrize("head", ["Position (cm)\n", "Force,Position\n(N),(cm)\n"])
def test_a_heading_that_comes_again_without_times_begins_another_run(tmp_path: Path, head: str) -> None:
    """The rows of each part are those between its heading and the next."""
    parts = [X, 2 * X[:40], 3 * X[:50]]
    rows = ("\n".join(f"{9 * x:.3f},{x:.4f}" if "," in head else f"{x:.4f}" for x in part) for part in parts)
    text = "\n\n".join(head + part for part in rows) + "\n"
    with pytest.raises(NeedsAnswer) as asked:
        read(tmp_path, text, channel="Position")
    assert len(asked.value.question.needs[0].choices) == len(parts)
    for number, part in enumerate(parts, 1):
        recording = read(tmp_path, text, channel="Position", run=f"{number}", rate_hz=20.0)
        holds(recording, T[: part.size], part)
        assert not recording.malformed_rows


def test_a_column_of_times_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """The answer does not invite a rate that nobody measured; a stated rate is taken."""
    text = table([f"tick {t:.2f}!" for t in T], [f"{x:.3f}" for x in X], head="Time;Position (cm)")
    with pytest.raises(FormatError) as refused:
        read(tmp_path, text)
    assert not isinstance(refused.value, NeedsAnswer)
    assert '"Time"' in str(refused.value)
    with pytest.raises(FormatError, match='"Time"'):
        read(tmp_path, text, time="Time")
    holds(read(tmp_path, text, rate_hz=20.0))


# Blocks

OTHER = np.round(9.0 + 0.5 * np.cos(4.0 * T), 3)


@pytest.mark.parametrize("heading", ["sensor", "who", "_field"])
@pytest.mark.parametrize("in_turn", [True, False])
def test_rows_of_several_sensors_are_channels(tmp_path: Path, heading: str, in_turn: bool) -> None:
    """A long table has one reading a row, and the name of the sensor in a column of words."""
    a, b = (
        [f"{t + late:.3f},{name},{x:.3f}" for t, x in zip(T, values, strict=True)]
        for name, values, late in (("left", X, 0.0), ("right", OTHER, 0.008))
    )
    rows = [row for pair in zip(a, b, strict=True) for row in pair] if in_turn else a + b
    text = "\n".join([f"time_s,{heading},distance_cm", *rows, ""])
    if not in_turn and heading == "who":  # words that change once are a state
        text = text.replace("who", "sensor")
    with pytest.raises(NeedsAnswer) as asked:
        read(tmp_path, text)
    assert asked.value.question.needs[0].choices == ("distance left", "distance right")
    holds(read(tmp_path, text, channel="distance left"))
    holds(read(tmp_path, text, channel="distance right"), T + 0.008, OTHER)


def test_a_state_in_words_is_no_sensor(tmp_path: Path) -> None:
    """Values go on from row to row, whatever the words say."""
    rows = [f"{t:.2f},{'low' if row % 3 else 'ok'},{x:.3f}" for row, (t, x) in enumerate(zip(T, X, strict=True))]
    holds(read(tmp_path, "\n".join(["Time (s),state,Position (cm)", *rows, ""])))


UNITS_OF_ROWS = {
    "column": ("Time (s),Value,Unit", "{t:.2f},{x},{u}"),
    "behind, in cells": ("Time (s);Value", "{t:.2f};{x} {u}"),
    "behind both": ("Time;Value", "{t:.2f} s;{x} {u}"),
    "blanks": ("", "{t:.2f} {x} {u}"),
    "alone": ("", "{x}{u}"),
}


@pytest.mark.parametrize("form", UNITS_OF_ROWS)
def test_the_unit_of_each_row_is_used(tmp_path: Path, form: str) -> None:
    """Instruments choose the unit of each value; an answer that contradicts the rows is refused."""
    head, row = UNITS_OF_ROWS[form]
    values = np.round(100.0 + X, 2)
    cells = [(f"{x / 100:.4f}", "m") if x >= 100 else (f"{10 * x:.1f}", "mm") for x in values]
    text = "\n".join(
        [*filter(None, [head]), *(row.format(t=t, x=x, u=u) for t, (x, u) in zip(T, cells, strict=True)), ""]
    )
    answers = {"rate_hz": 20.0} if form == "alone" else {}
    holds(read(tmp_path, text, **answers), x=values)
    with pytest.raises(FormatError, match="states its unit"):
        read(tmp_path, text, unit="cm", **answers)


LINES = {
    "numpy": ("{t}\n{x}\n", ","),
    "MATLAB": ("t = [{t}];\nx = [{x}];\n", " "),
    "names": ("Time (s);{t}\nPosition (cm);{x}\n", ";"),
    "names above": ("# Time (s), Position (cm)\n{t}\n{x}\n", ","),
}


@pytest.mark.parametrize("form", LINES)
def test_two_long_lines_are_two_columns(tmp_path: Path, form: str) -> None:
    """``numpy.savetxt`` of two arrays writes a line for each, longer than the head of a file."""
    t = np.arange(3000) / 20
    x = np.round(5.0 * np.cos(6.0 * t), 3)
    line, mark = LINES[form]
    text = line.format(t=mark.join(f"{each:.2f}" for each in t), x=mark.join(f"{each:.3f}" for each in x))
    answers = {} if "names" in form else {"unit": "cm"}
    holds(read(tmp_path, text, **answers), t, x)


def test_annotated_csv_of_influxdb(tmp_path: Path) -> None:
    """The bounds of the query are not the times of the rows."""
    head = "#group,false,false,true,true,false,false,true\n#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,"
    head += "dateTime:RFC3339,double,string\n#default,_result,,,,,,\n,result,table,_start,_stop,_time,_value,_field\n"
    bounds = "2024-05-01T10:00:00Z,2024-05-01T11:00:00Z"
    rows = [f",,0,{bounds},{at.isoformat()}Z,{x:.3f},distance" for at, x in zip(MOMENTS, X, strict=True)]
    holds(read(tmp_path, "\n".join([head + rows[0], *rows[1:], ""]), unit="cm"))


@pytest.mark.parametrize(
    ("scale", "head", "answers"),
    [(1, "Time (s);Position (m)", {"unit": "cm"}), (1000, "Time (s);Position (cm)", {"time_unit": "ms"})],
)
def test_an_answer_beats_the_heading(tmp_path: Path, scale: int, head: str, answers: dict[str, str]) -> None:
    """A person who states the unit knows better; it is noted."""
    text = table([f"{scale * t:.2f}" for t in T], [f"{x:.3f}" for x in X], head=head)
    recording = read(tmp_path, text, **answers)
    holds(recording)
    assert [each for each in recording.traps if each.code == "unit_given"]


# Values


TURNS = [("deg", 360.0, "{:.2f}"), ("rad", 2 * np.pi, "{:.5f}"), ("", 65536, "{:.0f}"), ("", 4096, "{:.0f}")]


@pytest.mark.parametrize(("unit", "turn", "form"), TURNS)
@pytest.mark.parametrize(("low", "turns"), [(0.0, 0.08), (-0.5, 0.08), (0.0, 0.6)])
def test_jumps_by_a_turn_are_undone(
    tmp_path: Path, unit: str, turn: float, form: str, low: float, turns: float
) -> None:
    """Angles and counters are written within one turn; the motion goes on beyond it, and this is noted."""
    true = (low + 0.01 + turns * np.cos(6.0 * T)) * turn
    cells = [form.format((each - low * turn) % turn + low * turn) for each in true]
    head = f"Time (s);Angle ({unit})" if unit else "Time (s);AcX"
    answers = {} if unit else {"unit": "1"}
    recording = read(tmp_path, table([f"{t:.2f}" for t in T], cells, head=head), **answers)
    steps = np.diff(true) * (np.pi / 180 if unit == "deg" else 1.0)
    np.testing.assert_allclose(np.diff(recording.samples.distance), steps, atol=turn * 1e-4 if unit else 1.0)
    assert [each for each in recording.traps if each.code == "values_unwrapped"]
