"""``springmass record`` and ``recover`` over a pseudo-terminal: the real serial code, a simulated sensor."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.decoders.registry import get_family
from acquisition.simulated import VirtualPort, VirtualRangefinder, VirtualSensor
from springmass import analyse, load
from springmass.cli import main
from storage.run_file.reading import open_run
from tests.cli.conftest import BENCH, Cli
from tests.faults.conftest import frame_of, line_of, on_a_terminal
from tests.sampling import sampled

OMEGA = 10.0
"""Of the bench, rad/s."""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Return the scene of a bench."""
    path = tmp_path / "bench.toml"
    path.write_text(BENCH)
    return path


@pytest.fixture
def silent_port() -> Iterator[str]:
    """Return a port on which nobody speaks."""
    with on_a_terminal(lambda _: b"") as port:
        yield port


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run of two seconds, recorded from the simulated sensor."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "bench.toml").write_text(BENCH)
    run = folder / "run.h5"
    assert main(["record", "--simulate", "--scene", str(folder / "bench.toml"), "--seconds", "2", "-o", str(run)]) == 0
    return run


def test_a_simulated_run_becomes_a_run_file_with_its_truth(recorded: Path) -> None:
    """Samples at 100 Hz, none lost, labelled simulated, with the frequency of the scene."""
    loaded = load(recorded).loaded
    assert loaded.info.kind == "simulated"
    assert loaded.info.clock == "device"
    assert len(loaded.samples) >= 100
    # A bob that swings is met a little sooner or later after each ping.
    np.testing.assert_allclose(np.diff(loaded.samples.t), 0.01, atol=1e-4)
    omega = analyse(recorded)["angular_frequency"]
    assert abs(omega.value - OMEGA) < 4.0 * omega.u
    assert not recorded.with_suffix(".wire").exists()


def test_another_speed_of_sound_is_applied_to_the_same_echoes(cli: Cli, tmp_path: Path, recorded: Path) -> None:
    """A run recorded with 344 m/s comes out of its log with any other speed, every distance in proportion."""
    assert cli("convert", recorded, tmp_path / "run.wire").code == 0
    done = cli("recover", tmp_path / "run.wire", "-o", tmp_path / "warm.h5", "--speed-of-sound", "350")
    assert done.code == 0, done.err
    first, second = load(recorded).loaded.samples, load(tmp_path / "warm.h5").loaded.samples
    np.testing.assert_allclose(second.distance, first.distance * 350 / 344, rtol=1e-12)


@pytest.mark.parametrize("name", ["run.h5", "run.wire", "run.part2.h5"])
def test_nothing_is_ever_recorded_over(cli: Cli, tmp_path: Path, scene: Path, name: str) -> None:
    """Where a run file or its log exists the command ends before it opens anything."""
    (tmp_path / name).write_bytes(b"precious")
    done = cli("record", "--simulate", "--scene", scene, "--seconds", "1", "-o", tmp_path / "run.h5")
    assert done.code == 2
    assert name in done.complaint
    assert (tmp_path / name).read_bytes() == b"precious"


def test_a_place_that_cannot_hold_the_run_is_refused_before_the_recording(
    cli: Cli, tmp_path: Path, scene: Path
) -> None:
    """A link to nothing, and a name too long for the log's suffix: one line, exit code 2, nothing recorded."""
    (tmp_path / "run.h5").symlink_to(tmp_path / "nowhere" / "run.h5")
    for out in (tmp_path / "run.h5", tmp_path / ("x" * 252 + ".h5")):
        done = cli("record", "--simulate", "--scene", scene, "--seconds", "1", "-o", out)
        assert (done.code, len(done.err.splitlines())) == (2, 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.toml", "run.h5"]


def test_two_sensors_give_two_run_files(cli: Cli, tmp_path: Path) -> None:
    """Several sensors in one run: one log, a run file each, both complete."""
    with on_a_terminal(line_of) as one, on_a_terminal(lambda number: frame_of(301 + number)) as other:
        done = cli(
            *("record", "--port", one, "--sensor", "line-protocol", "--port", other, "--sensor", "ffhls"),
            *("--rate-hz", "100", "--seconds", "1", "-o", tmp_path / "run.h5"),
        )
    assert done.code == 0, done.err
    for channel, family in enumerate(("line-protocol", "ffhls")):
        loaded = load(tmp_path / f"run.{channel}.h5").loaded
        assert len(loaded.samples) >= 20, family  # a hundred where the machine has time
        assert np.nanmin(loaded.samples.distance) > (0.3 if channel else 0.17)


def test_a_disk_nearly_full_is_told_before_a_run_starts(
    cli: Cli, tmp_path: Path, scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Less room than the run needs: one line, exit code 4, no port opened, no log."""
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
    done = cli("record", "--simulate", "--scene", scene, "--seconds", "60", "-o", tmp_path / "run.h5")
    assert done.code == 4
    assert not (tmp_path / "run.wire").exists()


def test_a_killed_recording_is_recovered_from_its_log(cli: Cli, tmp_path: Path, scene: Path) -> None:
    """After kill -9 the log gives a run file with the first second whole."""
    words = ["record", "--simulate", "--scene", str(scene), "-o", str(tmp_path / "run.h5")]
    command = [sys.executable, "-m", "springmass", *words]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
    assert child.stderr is not None
    assert any(" s | " in line for line in child.stderr)  # it has kept its first second
    child.kill()
    child.communicate(timeout=120)
    assert not (tmp_path / "run.h5").exists()
    done = cli("recover", tmp_path / "run.wire")
    assert done.code == 0, done.err
    with open_run(tmp_path / "run.h5") as run:
        samples = run.samples()
    assert len(samples) >= 20
    # A bob that swings is met a little sooner or later after each ping.
    np.testing.assert_allclose(np.diff(samples.t), 0.01, atol=1e-4)
    assert (tmp_path / "run.wire").exists()


@pytest.mark.trials
def test_a_port_is_probed(cli: Cli) -> None:
    """Listening to a port says which family speaks on it."""
    with on_a_terminal(line_of) as port:
        (found,) = cli("ports", "--port", port, "--json").results
    (row,) = [row for row in found["ports"] if row["device"] == port]
    assert row["families"][0] == "line-protocol"


class Hands:
    """Somebody at the bench: brings the target to the next place, then presses Enter."""

    def __init__(self, places: list[float]) -> None:
        self._places = list(places)
        self.place = places[0]

    def isatty(self) -> bool:
        """Be no terminal."""
        return False

    def readline(self) -> str:
        """Move, then press Enter; nothing where there is nowhere left to go."""
        if not self._places:
            return ""
        self.place = self._places.pop(0)
        return "\n"


def rulered(cli: Cli, tmp_path: Path, hands: Hands, *rulers: str) -> SimpleNamespace:
    """Record a still target with a speed of sound that is 2 % too high, calibrated by a ruler."""
    finder = VirtualRangefinder(lambda t: hands.place + 0.0 * t, VirtualSensor(), np.random.default_rng(5))
    with VirtualPort(get_family("line-protocol"), finder, SystemClock(), seconds=30.0) as sensor:
        sensor.start()
        return cli(
            *("record", "--port", sensor.path, "--sensor", "line-protocol", "--speed-of-sound", "350.88"),
            *("--still", "0.5", *(word for known in rulers for word in ("--ruler", known))),
            *("--seconds", "0.5", "-o", tmp_path / "run.h5"),
        )


def test_two_distances_by_the_ruler_set_offset_and_scale(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scale 2 % off is put right by two known distances."""
    hands = Hands([0.2, 0.6, 0.4])
    monkeypatch.setattr(sys, "stdin", hands)
    done = rulered(cli, tmp_path, hands, "0.2", "0.6")
    assert done.code == 0, done.err
    np.testing.assert_allclose(load(tmp_path / "run.h5").loaded.samples.distance[-10:], 0.4, atol=0.002)


def test_the_simulated_bob_hangs_still_until_its_rest_is_measured(cli: Cli, tmp_path: Path, scene: Path) -> None:
    """--still, --ruler and --trigger work without hardware: the ruler's distance is the rest, the run its motion."""
    done = cli(
        *("record", "--simulate", "--scene", scene, "--still", "0.5", "--ruler", "0.26"),
        *("--trigger", "0.01", "--pre", "0.2"),
        *("--seconds", "1", "-o", tmp_path / "run.h5"),
    )
    assert done.code == 0, done.err
    distance = load(tmp_path / "run.h5").loaded.samples.distance
    np.testing.assert_allclose(distance[:10], 0.26, atol=0.002)
    assert distance.max() > 0.3
    loaded = load(tmp_path / "run.h5").loaded
    assert loaded.track.trigger_s is not None
    # The moment is the host's stamp of that sample, which a busy machine gives late.
    samples = loaded.samples
    host_s = 1e-9 * (samples.host_ns - samples.host_ns[0])
    moment_s = host_s[int(np.argmax(np.abs(samples.distance - 0.26) > 0.01))] - (host_s - samples.t).min()
    assert abs(loaded.track.trigger_s - moment_s) < 0.03


def test_silence_ends_a_recording_before_it_starts(cli: Cli, tmp_path: Path, silent_port: str) -> None:
    """After the stated seconds a line says what to check; it ends with 4 and leaves no file."""
    named = ("--port", silent_port, "--sensor", "line-protocol", "--wait", "3")
    done = cli("record", *named, "-o", tmp_path / "run.h5")
    assert done.code == 4
    (line,) = done.err.splitlines()
    assert silent_port in line
    assert "--baud" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("away", sampled([0.005, 0.3], 1))
def test_useless_readings_are_said_at_once(cli: Cli, tmp_path: Path, away: float) -> None:
    """No target and an echo of something fixed are said with what to check; a run without a distance ends with 4."""
    finder = VirtualRangefinder(
        lambda _: away, VirtualSensor(noise_m=0.0, false_echo_rate_hz=0.0), np.random.default_rng(5)
    )
    with VirtualPort(get_family("line-protocol"), finder, SystemClock(), seconds=30.0) as sensor:
        sensor.start()
        named = ("--port", sensor.path, "--sensor", "line-protocol")
        done = cli("record", *named, "--seconds", "1.5", "-o", tmp_path / "run.h5")
    if away < 0.02:
        assert done.code == 4
        assert "no target" in done.err
    else:
        assert done.code == 0
        assert "unchanged" in done.err
    assert (tmp_path / "run.h5").is_file()


@pytest.mark.trials
def test_record_alone_finds_the_only_rangefinder(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, silent_port: str
) -> None:
    """Of two ports one speaks: it is named and recorded, into a file named by date, time and title."""
    monkeypatch.chdir(tmp_path)
    with on_a_terminal(line_of) as port:
        ports = [SimpleNamespace(device=each, description="", vid=None) for each in (silent_port, port)]
        monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
        done = cli("record", "--seconds", "0.5", "--title", "undamped bob")
        assert done.code == 0, done.err
        assert port in done.err.splitlines()[0]
    (run,) = tmp_path.glob("*.h5")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d_\d{4}_undamped-bob\.h5", run.name)


def test_no_rangefinder_and_several_are_told(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was heard on each port is said, with what to name; exit code 4."""
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    done = cli("record", "-o", tmp_path / "run.h5")
    assert (done.code, len(done.err.splitlines())) == (4, 1)
    with on_a_terminal(line_of) as one, on_a_terminal(line_of) as other:
        ports = [SimpleNamespace(device=port, description="", vid=None) for port in (one, other)]
        monkeypatch.setattr("serial.tools.list_ports.comports", lambda: ports)
        done = cli("record", "-o", tmp_path / "run.h5")
    assert done.code == 4
    assert other in done.complaint


@pytest.mark.parametrize(
    ("template", "options", "step_m"),
    [
        ("Distance: {cm:.1f} cm", [], 1e-3),
        ("({cm:.3f},)", [], 1e-5),
        ("{ms};{cm:.2f}", ["column=1", "time=0", "time_unit=ms"], 1e-4),
        ("{ms},{cm:.2f}", None, 1e-4),
    ],
)
def test_lines_of_a_sketch_are_recorded(
    tmp_path: Path, template: str, options: list[str] | None, step_m: float, capfd: pytest.CaptureFixture[str]
) -> None:
    """As they are, or with the options that the refusal names; every digit is there, and nothing is found wrong."""
    rng = np.random.default_rng(5)

    def send(number: int) -> bytes:
        distance_m = 0.4 + 0.05 * np.cos(0.01 * OMEGA * number) + 3e-4 * rng.standard_normal()
        line = template.format(ms=10 * number, cm=100 * distance_m)
        return (line.replace(".", ",") if ";" in template else line).encode() + b"\r\n"

    with on_a_terminal(send) as port:
        typed = ["record", "--port", port, "--sensor", "text-lines", "--seconds", "4"]
        typed += ["-o", str(tmp_path / "r.h5")]
        if options is None:
            assert main(typed) == 4
            asked = capfd.readouterr().err
            options = re.findall(r"--option (\w+=\w+)", asked)
        assert main([*typed, *(word for option in options for word in ("--option", option))]) == 0
    loaded = load(tmp_path / "r.h5").loaded
    assert loaded.info.quantum_m == pytest.approx(step_m)
    assert loaded.samples.distance.min() == pytest.approx(0.35, abs=2e-3)
    assert loaded.samples.distance.max() == pytest.approx(0.45, abs=2e-3)
    if "{ms}" not in template:
        return  # its times are those of a host that may be busy
    result = analyse(tmp_path / "r.h5")
    assert abs(result["angular_frequency"].value - OMEGA) < 5.0 * result["angular_frequency"].u
    assert "quantised" not in {finding.code for finding in result.findings} or step_m == 1e-3


def test_a_page_that_cannot_start_costs_no_recording(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page is only a viewer: the run is recorded, and a line says how to see it."""
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nowhere"))
    done = cli("record", "--simulate", "--seconds", "2", "--page", "--no-browser", "-o", tmp_path / "run.h5")
    assert (tmp_path / "run.h5").exists()
    assert done.code == 0
    assert "springmass page" in done.err
