"""``springmass formats``: which families there are, and what one file is."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import springmass
from acquisition.clock import VirtualClock
from acquisition.recordings.identify import formats
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry

Cli = Callable[..., Any]


def write_log(path: Path, channels: int) -> None:
    """Write a finished wire log of 200 readings for each sensor."""
    sensors = tuple(SensorEntry(channel, "maxbotix-hr", f"port{channel}") for channel in range(channels))
    with Recorder(path, LogHeader(sensors=sensors, mono_ns=0, unix_ns=0), VirtualClock()) as recorder:
        for i in range(200):
            for channel in range(channels):
                recorder.put(channel, 100_000_000 * (i + 1), b"R%04d\r" % (1000 + i % 50))


def facts_of(out: str) -> dict[str, str]:
    """Return the lines of a description, value by name; of several traps the last."""
    return dict(line.split(None, 1) for line in out.splitlines())


def test_the_list_names_every_family_and_run_files(cli: Cli) -> None:
    """One line a family, as text and as JSON."""
    done = cli("formats")
    assert done.code == 0
    names = [line.split()[0] for line in done.out.splitlines()]
    assert names == [*(family.name for family in formats()), "run", "wire"]
    (listed,) = cli("formats", "--json").results
    assert [entry["name"] for entry in listed] == names
    assert all(entry["title"] for entry in listed)


def test_a_recording_is_described(cli: Cli, data: Path) -> None:
    """Family, kind, samples, rate, clock and every trap, with numbers that a person can read."""
    done = cli("formats", data / "sixty_hz_simulated_position.txt")
    assert (done.code, done.err) == (0, "")
    facts = facts_of(done.out)
    assert (facts["format"], facts["kind"], facts["rate_hz"], facts["clock"]) == (
        "motion-sensor",
        "simulated",
        "60",
        "nominal",
    )
    loaded = springmass.load(data / "sixty_hz_simulated_position.txt")
    assert facts["to_s"] == f"{loaded.samples.t[-1]:.6g}"
    assert facts["samples"] == str(len(loaded.samples))
    assert facts["trap"].startswith("stated_error_is_not_noise: ")


def test_json_has_the_numbers_whole(cli: Cli, data: Path) -> None:
    """What is rounded for people is exact for programs."""
    path = data / "sixty_hz_simulated_position.txt"
    (facts,) = cli("formats", "--json", path).results
    loaded = springmass.load(path)
    assert (facts["to_s"], facts["quantum_m"]) == (float(loaded.samples.t[-1]), loaded.info.quantum_m)
    assert [trap["code"] for trap in facts["traps"]] == [trap.code for trap in loaded.traps]
    assert (facts["sha256"], facts["missing"]) == (loaded.sha256, 0)


def test_a_run_file_is_described(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """It says run, and what the recording inside was seen to be."""
    assert cli("convert", recording, tmp_path / "run.h5").code == 0
    facts = facts_of(cli("formats", tmp_path / "run.h5").out)
    assert (facts["format"], facts["kind"], facts["samples"]) == ("run", "replay", "1000")
    assert facts["title"] == "Motion Sensor Data File Mar 12, 2024 2:05 PM"


def test_a_trap_names_its_line(cli: Cli, write: Callable[..., Path], rows: list[bytes]) -> None:
    """Text in the middle is told with where it stands."""
    out = cli("formats", write([*rows[:50], b"oops", *rows[50:]])).out
    assert "(line 53)" in out
    assert facts_of(out)["malformed_rows"] == "1"


def test_channels_runs_and_what_is_missing_are_told(cli: Cli, tmp_path: Path) -> None:
    """A file that leaves a choice open is described all the same, with the question that every other command asks."""
    path = tmp_path / "run.csv"
    path.write_bytes(b'"Position (mm) Run #1";"Position (mm) Run #2"\r\n-19,6620;-14,9504\r\n-19,3720;\r\n')
    done = cli("formats", path)
    assert (done.code, done.err) == (0, "")
    facts = facts_of(done.out)
    assert facts["format"] == "capstone"
    assert facts["why"] == 'headings in line 1 end in a run, "Run #1"'
    assert "Run #1: Position (mm), 2 samples, rate not stated" in done.out
    assert "Run #2: Position (mm), 1 samples, rate not stated" in done.out
    assert facts["needs"].count("--run") == 1
    (result,) = cli("formats", "--json", path).results
    assert [(each["run"], each["name"], each["unit"], each["samples"]) for each in result["channels"]] == [
        ("Run #1", "Position", "mm", 2),
        ("Run #2", "Position", "mm", 1),
    ]
    done = cli("formats", path, "--run", "1", "--rate-hz", "50")
    assert facts_of(done.out)["rate_hz"] == "50"
    assert "rate_given" in done.out


def test_a_wire_log_is_an_input(cli: Cli, data: Path, tmp_path: Path) -> None:
    """What record leaves behind is described, converted and analysed like any recording; the log stays as it is."""
    log = tmp_path / "run.wire"
    write_log(log, channels=1)
    before = log.read_bytes()
    facts = facts_of(cli("formats", log).out)
    assert (facts["format"], facts["kind"], facts["samples"]) == ("wire", "live", "200")
    assert cli("convert", log, tmp_path / "run.h5").code == 0
    with springmass.open_run(tmp_path / "run.h5") as run:
        assert run.originals()[0].data == before == log.read_bytes()
        assert len(run.samples()) == 200
    assert cli("formats", log, "--rate-hz", "100").code == 2


def test_the_sensors_of_a_wire_log_are_its_channels(cli: Cli, tmp_path: Path) -> None:
    """Several and none chosen: the line lists them; chosen by number or port."""
    log = tmp_path / "run.wire"
    write_log(log, channels=2)
    done = cli("formats", log)
    assert done.code == 3
    assert "the log holds the sensors 0 at port0, 1 at port1" in done.complaint
    assert done.complaint.endswith(f"springmass formats {log} --channel 0")
    for name in ("1", "port1"):
        assert facts_of(cli("formats", log, "--channel", name).out)["samples"] == "200"
    assert 'channel "7" is not in the log' in cli("formats", log, "--channel", "7").complaint


def test_a_name_that_no_terminal_can_show_is_shown_escaped(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Bytes without meaning in a file's name are no reason to fail."""
    odd = recording.rename(tmp_path / "a\udcff.txt")
    done = cli("formats", odd)
    assert done.code == 0
    assert "a\\udcff.txt" in done.out


def test_a_folder_is_one_table(cli: Cli, tmp_path: Path) -> None:
    """A row a file: family, channels, rate, span and what is missing; what is no recording says why."""
    shelf = tmp_path / "shelf"
    (shelf / "old").mkdir(parents=True)
    rows = "".join(f"{i / 10:.1f},{0.1 * (i % 4):.1f},{i % 3}\n" for i in range(41))
    (shelf / "a.csv").write_text("Time (s),Position (m),n\n" + rows, encoding="utf-8")
    (shelf / "old" / "b.csv").write_text("t,x,y\n" + rows, encoding="utf-8")
    (shelf / "notes.md").write_text("What we did.\n", encoding="utf-8")
    (shelf / ".hidden").write_text(rows, encoding="utf-8")
    done = cli("formats", shelf)
    assert (done.code, done.err) == (0, "")
    table = [line.split() for line in done.out.splitlines()]
    assert table[0] == ["file", "family", "channels", "rate", "span", "missing"]
    assert table[1] == ["a.csv", "table", "Position", "10", "Hz", "4", "s"]
    assert table[2] == ["notes.md", "none", "no", "format", "recognises", "it"]
    assert table[3] == ["old/b.csv", "tracker", "x,", "y", "10", "Hz", "4", "s", "--channel,", "--unit"]
    entries = cli("formats", "--json", shelf).results
    assert [each["file"] for each in entries] == ["a.csv", "notes.md", "old/b.csv"]
    assert entries[2]["missing"] == ["channel", "unit"]


def test_a_run_of_a_zip_is_analysed(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A MotionSensor.vi pair and a table beside it: all in one table, and each a run that the line names."""
    path = tmp_path / "shelf.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("undamped_simulated_position.txt", "undamped_simulated_velocity.txt"):
            archive.write(data / name, name)
        archive.writestr("run.csv", "Time (s),Position (m)\n" + "".join(f"{i / 10},{i % 3}\n" for i in range(40)))
    families = [line.split()[1] for line in cli("formats", path).out.splitlines()[1:]]
    assert families == ["motion-sensor", "motion-sensor", "csv"]
    refused = cli("analyse", path, "--json")
    assert refused.code == 3
    assert "which of the 3 runs" in refused.complaint
    (found,) = cli("analyse", path, "--json", "--run", "undamped_simulated_position.txt").results
    (alone,) = cli("analyse", data / "undamped_simulated_position.txt", "--json").results
    assert found["input"]["kind"] == "simulated"
    mine, its = (each["estimates"]["period"] for each in (found, alone))
    assert abs(mine["value"] - its["value"]) < its["u"]


def test_a_zip_is_one_table(cli: Cli, tmp_path: Path) -> None:
    """As a folder is, whatever its files are called."""
    with zipfile.ZipFile(tmp_path / "runs.zip", "w") as archive:
        for name in ("a.csv", "../a.csv", "deep/a.csv"):
            archive.writestr(name, "Time (s),Position (m)\n0.0,0.1\n0.1,0.3\n0.2,0.2\n0.3,0.1\n")
    done = cli("formats", tmp_path / "runs.zip")
    assert done.code == 0
    assert [line.split()[:3] for line in done.out.splitlines()[1:]] == [
        ["a.csv", "csv", "Position"],
        ["../a.csv", "csv", "Position"],
        ["deep/a.csv", "csv", "Position"],
    ]
    assert not (tmp_path.parent / "a.csv").exists()


def test_how_a_file_is_read_is_shown(cli: Cli, tmp_path: Path) -> None:
    """The text above the rows is kept and shown, each column with its meaning and its first cells."""
    path = tmp_path / "run.txt"
    rows = "\n".join(f"{i}\t{i / 10:.1f}\t{i % 3}\tok" for i in range(9))
    path.write_text(f"Pendulum 3\nn\tt (s)\ttheta (rad)\tstate\n{rows}\n", encoding="utf-8")
    lines = cli("formats", "--explain", path).out.splitlines()
    assert lines == [
        'format     table: numbers begin in line 3, below "n", "t", "theta", "state"',
        "above      line 1     Pendulum 3",
        "above      line 2     n\\tt (s)\\ttheta (rad)\\tstate",
        "column 1   n: read only if it is named: 0, 1, 2, 3, ...",
        "column 2   t (s): time: 0.0, 0.1, 0.2, 0.3, ...",
        "column 3   theta (rad): channel: 0, 1, 2, 0, ...",
        "column 4   state: read only if it is named: ok, ok, ok, ok, ...",
    ]
    (result,) = cli("formats", "--explain", "--json", path).results
    assert result["tables"][0]["columns"][1]["meaning"] == "time"


def test_how_markup_is_read_is_shown(cli: Cli, tmp_path: Path) -> None:
    """Numbers that stand in XML have no lines above them."""
    path = tmp_path / "run.labx"
    channels = "".join(
        f"<channel><quantity>{name}</quantity><symbol>{name[0]}</symbol><unit>{unit}</unit>"
        f"<values>{''.join(f'<value>{x}</value>' for x in values)}</values></channel>"
        for name, unit, values in (("Zeit", "s", (0, 1, 2)), ("Weg", "m", (0.1, 0.2, 0.1)))
    )
    path.write_text(f"<?xml version='1.0'?><cassylab>{channels}</cassylab>", encoding="utf-8")
    assert cli("formats", "--explain", path).out.splitlines() == [
        "format     cassy: it is XML with the root <cassylab>",
        "column 1   Zeit Z (s): time: 0, 1, 2, ...",
        "column 2   Weg W (m): channel: 0.1, 0.2, 0.1, ...",
    ]


def test_explaining_a_run_file_is_refused(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """It has no columns, and one line says so."""
    assert cli("convert", recording, tmp_path / "run.h5").code == 0
    done = cli("formats", "--explain", tmp_path / "run.h5")
    assert done.code == 2
    assert "--explain shows columns of old recordings, got a run file" in done.err
