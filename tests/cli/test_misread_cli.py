"""Files as people really have them: the command line goes in, and a period, a question or one line comes out."""

import re
import shlex
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.conftest import Cli
from tests.cli.not_recordings import TABLES

PERIOD_S = 0.790066


def swing(t: np.ndarray, seed: int = 1, noise: float = 8e-5, rest: float = 0.219) -> np.ndarray:
    """Return positions of a bob in m: 52 mm at the start, damped with 0.015 1/s."""
    noisy = np.random.default_rng(seed).normal(0.0, noise, t.size)
    return rest + 0.052 * np.exp(-0.015 * t) * np.cos(2 * np.pi / PERIOD_S * t) + noisy


T = np.arange(2000) / 100
Y = swing(T)


def lines(*rows: str, end: str = "\n") -> str:
    """Return lines of a text."""
    return end.join([*rows, ""])


def stamps(pattern: str, start: str = "2025-04-17T17:00:08", t: np.ndarray = T) -> list[str]:
    """Return clock times; ``{ms}`` in the pattern stands for three digits of milliseconds."""
    begun = datetime.fromisoformat(start)
    moments = [begun + timedelta(milliseconds=round(1e3 * each)) for each in t]
    return [each.strftime(pattern.replace("{ms}", f"{each.microsecond // 1000:03d}")) for each in moments]


@pytest.fixture
def read(cli: Cli, tmp_path: Path) -> Callable[..., Any]:
    """Return a function that analyses a text or bytes as a file, and checks the period; it returns the result."""

    def analysed(content: str | bytes | Path, *options: str, name: str = "run.csv", period_s: float = PERIOD_S) -> Any:
        path = tmp_path / name
        if not isinstance(content, Path):
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        done = cli("analyse", content if isinstance(content, Path) else path, "--json", *options)
        assert done.err == ""
        (result,) = done.results
        period = result["estimates"]["period"]
        assert abs(period["value"] - period_s) < 5.0 * period["u"] < 0.005 * period_s
        return result

    return analysed


def codes(result: Any) -> set[str]:
    """Return the codes of the warnings and errors of a result."""
    return {each["code"] for each in result["findings"] if each["severity"] != "info"}


def rewritten(values: np.ndarray, form: str = "{:.3f}") -> list[str]:
    """Return numbers as text."""
    return [form.format(each) for each in values]


def csv(heading: str, *columns: list[str], mark: str = ",") -> str:
    """Return a table with a line of headings."""
    return lines(heading, *(mark.join(row) for row in zip(*columns, strict=True)))


# LabVIEW


def tdms(path: Path, channels: dict[str, np.ndarray], **properties: object) -> Path:
    """Write a TDMS file of two segments; the properties are those of the last channel."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        for half in (slice(0, 1200), slice(1200, None)):
            writer.write_segment(
                [
                    ChannelObject("run", name, values[half], properties if at == len(channels) - 1 else {})
                    for at, (name, values) in enumerate(channels.items())
                ]
            )
    return path


def test_a_channel_of_time_stamps_is_the_time(read: Callable[..., Any], tmp_path: Path) -> None:
    """Without an increment."""
    clock = np.datetime64("2024-05-11T14:37:48.300000") + np.round(1e6 * T).astype("timedelta64[us]")
    path = tdms(tmp_path / "run.tdms", {"Timestamp": clock, "Distance": 100 * Y}, unit_string="cm")
    result = read(path)
    assert result["input"]["rate_hz"] == 100.0


def test_a_placeholder_gives_way_to_the_rate_that_is_stated(cli: Cli, read: Callable[..., Any], tmp_path: Path) -> None:
    """An increment of one second is read, and it is said what it may be; any other one is not overruled."""
    path = tdms(tmp_path / "run.tdms", {"Untitled": 100 * Y}, wf_increment=1.0)
    result = read(path, "--unit", "cm", "--rate-hz", "100")
    assert "rate_assumed" not in codes(result)
    slow = read(path, "--unit", "cm", period_s=100 * PERIOD_S)
    assert "rate_assumed" in codes(slow)
    other = tdms(tmp_path / "other.tdms", {"Untitled": 100 * Y}, wf_increment=0.5)
    assert "2 Hz" in cli("analyse", other, "--unit", "cm", "--rate-hz", "100").complaint


@pytest.mark.parametrize("left_out", [10, 900, 4000])
def test_a_cut_file_is_a_finding(read: Callable[..., Any], tmp_path: Path, left_out: int) -> None:
    """What was written is read, and no library speaks on stderr."""
    path = tdms(tmp_path / "run.tdms", {"Distance": 100 * Y}, unit_string="cm", wf_increment=0.01)
    path.write_bytes(path.read_bytes()[:-left_out])
    assert "truncated_row" in codes(read(path))


def lvm(starts: np.ndarray, size: int = 100) -> str:
    """Return an LVM file with a segment from each start."""
    head = ["LabVIEW Measurement", "Separator\tTab", "Multi_Headings\tYes", "X_Columns\tOne", "***End_of_Header***", ""]
    rows = list(head)
    for start in starts:
        t = start + np.arange(size) / 100
        rows += ["Channels\t1", f"Samples\t{size}", "Y_Unit_Label\tcm", f"X0\t{start:.6f}", "Delta_X\t0.010000"]
        rows += ["***End_of_Header***\t\t", "X_Value\tDistance\tComment"]
        rows += [f"{a:.6f}\t{100 * b:.4f}\t" for a, b in zip(t, swing(t, seed=int(start)), strict=True)]
    return lines(*rows, end="\r\n")


def test_segments_that_run_on_are_offered_as_one_run(cli: Cli, read: Callable[..., Any], tmp_path: Path) -> None:
    """As the first answer to the question; each can still be chosen."""
    path = tmp_path / "run.lvm"
    path.write_text(lvm(np.arange(20.0)))
    asked = cli("analyse", path, "--json")
    assert asked.code == 3
    _, *suggested = shlex.split(asked.complaint[asked.complaint.index("? springmass ") + 2 :])
    assert suggested[-2] == "--run"
    assert read(path, *suggested[-2:])["input"]["samples"] == 2000
    assert cli("analyse", path, "--json", "--run", "Segment 2").results[0]["input"]["samples"] == 100


# Tables that open as they are, or with what is stated


CM, SLOW = rewritten(100 * Y), np.arange(600) * 0.05
SLOW_MM = [rewritten(1e3 * SLOW, "{:.0f}"), rewritten(1e3 * swing(SLOW), "{:.0f}")]
COMMA = [f"{a:.2f};{100 * b:.2f}".replace(".", ",") for a, b in zip(T, Y, strict=True)]


def sketch(line: str) -> str:
    """Return what a sketch prints."""
    return lines(*(line.format(cm=100 * y, inch=y / 0.0254, ms=round(1e3 * t)) for t, y in zip(T, Y, strict=True)))


READ: dict[str, tuple[str, tuple[str, ...]]] = {
    "colons before milliseconds": (csv("RX Date/Time,x (cm)", stamps("%Y/%m/%d %H:%M:%S::{ms}"), CM), ()),
    "colons and a date": (csv("Zeit,x (cm)", stamps("%d.%m.%Y %H:%M:%S:{ms}"), CM), ()),
    "an apostrophe": (csv("Time,x (cm)", [f"'0:{int(t) // 60}:{t % 60:.2f}" for t in T], CM), ()),
    "fractions of a day": (csv("Time,x (cm)", rewritten(0.6096 + T / 86400, "{:.12f}"), CM), ("--time-unit", "days")),
    "nanoseconds": (csv("nanoseconds,x (cm)", rewritten(1e9 * T, "{:g}"), CM), ("--time", "nanoseconds")),
    "Spanish seconds": (csv("Tiempo (seg),x (cm)", rewritten(T, "{:g}"), CM), ()),
    "integers": (csv("millis,distance_mm", *SLOW_MM), ("--time-unit", "ms")),
    "integers, no units": (csv("time,dist", *SLOW_MM), ("--time-unit", "ms", "--unit", "mm")),
    "a comma before the unit": (csv("Time, s,Distance, cm", rewritten(T), CM), ()),
    "semicolons by option": (lines(*COMMA), ("--unit", "cm", "--delimiter", ";")),
    "a channel's beginning": (
        csv("Time (s),Height (cm),Distance to bob (cm)", rewritten(T), rewritten(100 * swing(T, seed=4)), CM),
        ("--channel", "DIST"),
    ),
    "two units of a sketch": (sketch("{inch:.2f}in, {cm:.2f}cm"), ("--rate-hz", "100")),
    "a sketch with its clock": (sketch("Time:{ms}\tDist:{cm:.2f}"), ("--time-unit", "ms", "--unit", "cm")),
}


@pytest.mark.parametrize("name", READ)
def test_tables_that_people_have_are_read(read: Callable[..., Any], name: str) -> None:
    """As they are, or with what only their writer knows."""
    content, options = READ[name]
    read(content, *options)


# Times


@pytest.mark.parametrize("step_s", [0.01, 0.05])
def test_stamps_without_a_fraction_on_whole_seconds_are_read(read: Callable[..., Any], step_s: float) -> None:
    """As Python's isoformat writes them."""
    t = np.arange(1500) * step_s
    begun = datetime.fromisoformat("2025-04-17T17:00:08")
    clock = [(begun + timedelta(microseconds=round(1e6 * each))).isoformat() for each in t]
    result = read(csv("timestamp,distance_m", clock, rewritten(swing(t), "{:.5f}")))
    assert result["input"]["samples"] == 1500
    assert "malformed_rows" not in codes(result)


def jump(after_s: float, by_s: float, seconds: float = 30.0) -> str:
    """Return a run whose clock is set after some seconds."""
    t = np.arange(round(100 * seconds)) / 100
    shown = np.where(t < after_s, t, t + by_s)
    clock = stamps("%Y-%m-%d %H:%M:%S.{ms}", "2025-03-30T01:59:50", shown)
    return csv("Timestamp,Distance (m)", clock, rewritten(swing(t), "{:.5f}"))


@pytest.mark.parametrize("by_s", [3600.0, 7200.0, 200_000.0])
def test_a_clock_that_was_set_forward_is_a_jump(read: Callable[..., Any], tmp_path: Path, by_s: float) -> None:
    """The longest unbroken part is analysed, the jump named with its lines, and the other part can be chosen."""
    t = np.arange(3000) / 100
    shown = np.where(t < 10.0, t, t + by_s)
    table = csv("Time (s),Distance (m)", rewritten(shown, "{:.2f}"), rewritten(swing(t), "{:.5f}"))
    result = read(jump(10.0, by_s) if by_s < 86400.0 else table)
    (said,) = [each for each in result["findings"] if each["code"] == "time_jump"]
    assert f"{by_s:.0f} s" in said["message"]
    assert "lines 1001 and 1002" in said["message"]
    assert "after it" in said["advice"]
    read(tmp_path / "run.csv", "--to", "9.9")


def test_a_clock_that_was_set_back_by_an_hour_goes_on(read: Callable[..., Any]) -> None:
    """The end of summer time: with an hour more, the step is as usual."""
    result = read(jump(10.0, -3600.0))
    assert result["input"]["samples"] == 3000
    assert [each for each in result["findings"] if each["code"] == "times_mended"]


def test_a_clock_that_was_set_back_makes_two_runs(cli: Cli, read: Callable[..., Any], tmp_path: Path) -> None:
    """No wrap of a counter explains the step."""
    path = tmp_path / "run.csv"
    path.write_text(jump(10.0, -1234.0))
    asked = cli("analyse", path, "--json")
    assert asked.code == 3
    assert "--run" in asked.complaint
    sizes = [read(path, "--run", run)["input"]["samples"] for run in ("1", "2")]
    assert sorted(sizes) == [1000, 2000]


# Separators and headings


def test_rows_with_more_cells_than_names_are_refused_with_the_reason(cli: Cli, tmp_path: Path) -> None:
    """Decimal commas in the times alone."""
    table = csv("Time(s), Echo", [f"{t:g}".replace(".", ",") for t in T], rewritten(100 * Y, "{:.2f}"))
    path = tmp_path / "run.csv"
    path.write_text(lines("; CSV, generated by a logger", "; Channels (1/1)") + table)
    done = cli("analyse", path)
    assert done.code == 3
    assert "decimal comma" in done.complaint
    assert "export" in done.complaint


# Channels


def test_a_question_names_at_most_eight_channels_and_one_whole_command(cli: Cli, tmp_path: Path) -> None:
    """The likely ones first, with an example that is marked as such."""
    names = [f"raw{i}" for i in range(14)] + ["position"]
    path = tmp_path / "run.csv"
    columns = [rewritten(100 * swing(T, seed=i)) for i in range(15)]
    path.write_text(csv(",".join(["t", *names]), rewritten(T, "{:.2f}"), *columns))
    asked = cli("analyse", path, "--no-report")
    question, _, command = asked.complaint.partition("? ")
    assert len(re.findall(r'"raw\d+"', question)) <= 8
    assert question.index('"position"') < question.index('"raw0"')
    assert command.count("springmass") == 1


def test_times_and_values_in_turn_are_pairs(read: Callable[..., Any], tmp_path: Path) -> None:
    """Not a column with half of its rows missing."""
    rows = [line for t, y in zip(T, Y, strict=True) for line in (f"{t:.2f}", f"{100 * y:.3f},{100 * t % 7:.0f}")]
    path = tmp_path / "log.txt"
    path.write_text(lines(*rows))
    read(path, "--channel", "column 2", "--unit", "cm")


def test_positions_counted_from_rest_are_ordinary(read: Callable[..., Any]) -> None:
    """Values of both signs are no distances of a rangefinder, and their rest position is known as well as any."""
    t = np.arange(900) / 30
    y = swing(t, noise=1e-3, rest=0.0031)
    rows = [f"{a:.3f}\t{b:.4E}" for a, b in zip(t, y, strict=True)]
    result = read(lines("mass A", "t\tx", *rows), "--unit", "m", name="run.txt")
    assert "implausible_distance" not in codes(result)
    rest = result["estimates"]["offset"]
    assert abs(rest["value"] - 0.0031) < 5 * rest["u"]
    assert rest["u"] < 2e-4


@pytest.mark.parametrize("between", ["", "0\t0\t0"])
def test_two_data_sets_below_each_other_are_two_runs(
    read: Callable[..., Any], cli: Cli, tmp_path: Path, between: str
) -> None:
    """In Vernier's format; with a blank line or zeros between them."""
    content: list[str] = []
    for run, t in (("Run 1", T), ("Run 2", 0.96 * T)):
        content += ["Vernier Format 2", "Lab 1/22/2008 2:38:45", run, "Time\tPosition", "Time\tPos", "s\tm", ""]
        content += [f"{a:.2f}\t{b:.5f}" for a, b in zip(T, swing(t), strict=True)] + [between]
    path = tmp_path / "run.txt"
    path.write_text(lines(*content))
    assert cli("analyse", path).code == 3
    read(path, "--run", "Run 1")
    read(path, "--run", "Run 2", period_s=PERIOD_S / 0.96)


@pytest.mark.parametrize("name", TABLES)
def test_a_table_that_is_no_recording_is_answered_as_such(cli: Cli, tmp_path: Path, name: str) -> None:
    """One line says what it looks like and what a recording needs; nothing is asked."""
    path = tmp_path / "table.csv"
    path.write_text(TABLES[name])
    done = cli("analyse", path)
    assert (done.code, done.out) == (3, "")
    assert "not a recording" in done.complaint
    assert "?" not in done.complaint
