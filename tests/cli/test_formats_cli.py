"""``springmass formats``: which families there are, and what one file is."""

import zipfile
from pathlib import Path

from acquisition.clock import VirtualClock
from storage.recorder import Recorder
from storage.wire_log.records import LogHeader, SensorEntry
from tests.cli.conftest import Cli


def test_the_sensors_of_a_wire_log_are_its_channels(cli: Cli, tmp_path: Path) -> None:
    """Several and none chosen: the line lists them; chosen by number or port."""
    log, sensors = tmp_path / "run.wire", tuple(SensorEntry(at, "maxbotix-hr", f"port{at}") for at in (0, 1))
    with Recorder(log, LogHeader(sensors=sensors, mono_ns=0, unix_ns=0), VirtualClock()) as recorder:
        for i in range(200):
            recorder.reads([(at, 100_000_000 * (i + 1), b"R%04d\r" % (1000 + i % 50)) for at in (0, 1)])
    done = cli("formats", log)
    assert done.code == 3
    assert "port0" in done.complaint
    assert done.complaint.endswith(f"springmass formats {log} --channel 0")
    for name in ("1", "port1"):
        facts = dict(line.split(None, 1) for line in cli("formats", log, "--channel", name).out.splitlines())
        assert (facts["format"], facts["kind"], facts["samples"]) == ("wire", "live", "200")


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
