"""``springmass formats``: which families there are, and what one file is."""

import zipfile
from pathlib import Path

from acquisition.clock import VirtualClock
from storage.recorder import Recorder
from storage.run_file.reading import open_run
from storage.wire_log.records import LogHeader, SensorEntry
from tests.cli.conftest import Cli


def write_log(path: Path, channels: int) -> None:
    """Write a finished wire log of 200 readings for each sensor."""
    sensors = tuple(SensorEntry(channel, "maxbotix-hr", f"port{channel}") for channel in range(channels))
    with Recorder(path, LogHeader(sensors=sensors, mono_ns=0, unix_ns=0), VirtualClock()) as recorder:
        for i in range(200):
            for channel in range(channels):
                recorder.reads([(channel, 100_000_000 * (i + 1), b"R%04d\r" % (1000 + i % 50))])


def facts_of(out: str) -> dict[str, str]:
    """Return the lines of a description, value by name; of several traps the last."""
    return dict(line.split(None, 1) for line in out.splitlines())


def test_a_wire_log_is_an_input(cli: Cli, data: Path, tmp_path: Path) -> None:
    """What record leaves behind is described, converted and analysed like any recording; the log stays as it is."""
    log = tmp_path / "run.wire"
    write_log(log, channels=1)
    before = log.read_bytes()
    facts = facts_of(cli("formats", log).out)
    assert (facts["format"], facts["kind"], facts["samples"]) == ("wire", "live", "200")
    assert cli("convert", log, tmp_path / "run.h5").code == 0
    with open_run(tmp_path / "run.h5") as run:
        assert run.originals()[0].data == before == log.read_bytes()
        assert len(run.samples()) == 200
    assert cli("formats", log, "--rate-hz", "100").code == 2


def test_the_sensors_of_a_wire_log_are_its_channels(cli: Cli, tmp_path: Path) -> None:
    """Several and none chosen: the line lists them; chosen by number or port."""
    log = tmp_path / "run.wire"
    write_log(log, channels=2)
    done = cli("formats", log)
    assert done.code == 3
    assert "port0" in done.complaint
    assert done.complaint.endswith(f"springmass formats {log} --channel 0")
    for name in ("1", "port1"):
        assert facts_of(cli("formats", log, "--channel", name).out)["samples"] == "200"


def test_a_run_of_a_zip_is_analysed(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A MotionSensor.vi pair and a table beside it: both are listed, and each is a run that the line names."""
    path = tmp_path / "shelf.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("undamped_simulated_position.txt", "undamped_simulated_velocity.txt"):
            archive.write(data / name, name)
        archive.writestr("run.csv", "Time (s),Position (m)\n" + "".join(f"{i / 10},{i % 3}\n" for i in range(40)))
    assert cli("formats", path).out.count("\nholds") == 4
    refused = cli("analyse", path, "--json")
    assert refused.code == 3
    assert "--run" in refused.complaint
    (found,) = cli("analyse", path, "--json", "--run", "undamped_simulated_position.txt").results
    (alone,) = cli("analyse", data / "undamped_simulated_position.txt", "--json").results
    assert found["input"]["kind"] == "simulated"
    mine, its = (each["estimates"]["period"] for each in (found, alone))
    assert abs(mine["value"] - its["value"]) < its["u"]
