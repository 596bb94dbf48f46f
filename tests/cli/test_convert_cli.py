"""``springmass convert``: an old recording into a run file and back, bit for bit, and nothing overwritten unasked."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from acquisition.block import Block
from acquisition.recordings.recording import Original
from springmass.loading.scenes import read_scene
from storage.run_file.reading import open_run
from storage.run_file.writing import write_run
from tests.cli.conftest import Cli
from tests.wire import bits


def test_a_pair_comes_back_into_a_folder(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Both files of a pair travel inside, under their own names."""
    names = [f"undamped_simulated_{what}.txt" for what in ("position", "velocity")]
    run, folder = tmp_path / "run.h5", tmp_path / "back"
    folder.mkdir()
    assert cli("convert", data / names[0], run, "--velocity", data / names[1]).code == 0
    assert cli("convert", run, folder).code == 0
    assert sorted(path.name for path in folder.iterdir()) == names
    assert all((folder / name).read_bytes() == (data / name).read_bytes() for name in names)
    with open_run(run) as file:
        velocity = file.samples().velocity
    assert velocity is not None
    assert np.isfinite(velocity).sum() > 900


def test_an_original_chooses_no_folder(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A name from outside that climbs out of the folder keeps its last part alone."""
    loaded = springmass.load(recording).loaded
    run = write_run(tmp_path / "run.h5", [loaded.samples], loaded.info, originals=[Original("../../escaped.txt", b"x")])
    folder = tmp_path / "deep" / "back"
    folder.mkdir(parents=True)
    assert cli("convert", run, folder).code == 0
    assert [path.name for path in folder.iterdir()] == ["escaped.txt"]
    assert not (tmp_path / "escaped.txt").exists()


def test_nothing_is_overwritten_unasked(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A run file and an original that stand there stay as they are, until --overwrite says otherwise."""
    run, back = tmp_path / "run.h5", tmp_path / "back.txt"
    back.write_bytes(b"mine")
    assert cli("convert", recording, run).code == 0
    before = run.read_bytes()
    for source, target in ((recording, run), (run, back)):
        done = cli("convert", source, target)
        assert done.code == 2
        assert str(target) in done.complaint
    assert (run.read_bytes(), back.read_bytes()) == (before, b"mine")
    assert cli("convert", run, back, "--overwrite").code == 0
    assert back.read_bytes() == recording.read_bytes()
    assert cli("convert", recording, run, "--overwrite").code == 0


def test_a_run_file_converts_to_one_that_says_the_same(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A scene put in, samples, originals, traps, family and origin survive the way through a second run file."""
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    old = springmass.load(data / "undamped_simulated_position.txt").loaded
    write_run(
        first,
        [old.samples],
        old.info,
        originals=old.originals,
        traps=old.traps,
        title=old.title,
        format="motion-sensor",
        provenance={"start_time": "2024-03-12T14:05:00Z", "configuration": {"gain": 2}},
    )
    assert cli("convert", first, second, "--scene", data / "undamped.scene.toml").code == 0
    with open_run(first) as a, open_run(second) as b:
        assert bits(a.samples()) == bits(b.samples())
        assert (a.info, a.header.title, a.traps, a.header.format) == (b.info, b.header.title, b.traps, b.header.format)
        assert a.originals() == b.originals()
        assert dict(b.provenance) | dict(a.provenance) == b.provenance
        assert b.header.scene == read_scene(data / "undamped.scene.toml").to_mapping()


@pytest.mark.parametrize("suffix", [".txt", ".csv"])
def test_what_is_written_in_another_form_reads_back(cli: Cli, data: Path, tmp_path: Path, suffix: str) -> None:
    """Times, distances, rate, quantum and kind survive the way through MotionSensor.vi and CSV."""
    recording, out = data / "sixty_hz_simulated_position.txt", tmp_path / f"back{suffix}"
    old = springmass.load(recording).loaded
    assert cli("convert", recording, out).code == 0
    new = springmass.load(out).loaded
    np.testing.assert_allclose(new.samples.t, old.samples.t, atol=1e-12)
    np.testing.assert_allclose(new.samples.distance, old.samples.distance, atol=1e-12)
    assert (new.info.rate_hz, new.info.kind, new.info.clock) == (old.info.rate_hz, "simulated", "nominal")
    assert new.info.quantum_m == pytest.approx(old.info.quantum_m)


def test_a_pair_written_is_a_pair_read(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Position and velocity files join again, and each velocity is the difference of its positions."""
    assert cli("convert", data / "undamped_simulated_position.txt", tmp_path / "run_position.txt").code == 0
    pair = springmass.load(tmp_path / "run_position.txt", velocity=tmp_path / "run_velocity.txt").loaded
    assert "pair_mismatch" not in {trap.code for trap in pair.traps}
    assert pair.samples.velocity is not None
    expected = np.diff(pair.samples.distance) * 100
    np.testing.assert_allclose(pair.samples.velocity[1:], expected, atol=1.1e-5)


def test_what_a_form_has_no_room_for_is_told(cli: Cli, write: Any, rows: list[bytes], tmp_path: Path) -> None:
    """Flags are lost in rows of numbers; times that a form cannot tell apart are refused."""
    recording = write([*rows[:50], rows[49], *rows[50:]])
    done = cli("convert", recording, tmp_path / "a.csv")
    assert "flags of 1 sample" in done.err
    fast = tmp_path / "fast.csv"
    fast.write_text("Time (s),Distance (m)\n" + "".join(f"{i / 10_000:.4f},0.{i:04d}\n" for i in range(99)))
    done = cli("convert", fast, tmp_path / "b.txt")
    assert done.code == 3
    assert not (tmp_path / "b.txt").exists()
    assert cli("convert", fast, tmp_path / "b.csv").code == 0
    assert springmass.load(tmp_path / "b.csv").loaded.info.rate_hz == 10_000.0


def test_an_empty_run_is_converted_too(cli: Cli, tmp_path: Path, recording: Path) -> None:
    """A run stopped before its first sample still gives back what travels inside; only analysing it fails."""
    info = springmass.load(recording).loaded.info
    run = write_run(tmp_path / "run.h5", [], info, originals=[Original("a.txt", b"header\n")])
    assert cli("convert", run, tmp_path / "back.txt").code == 0
    assert (tmp_path / "back.txt").read_bytes() == b"header\n"
    assert cli("formats", run).code == 0
    done = cli("analyse", "--json", run)
    assert (done.code, done.out) == (3, "")
    assert str(run) in done.complaint


def test_an_angle_goes_into_run_files_only(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """It comes from one run file into another with its unit; a form that prints metres refuses it."""
    info = springmass.load(recording).loaded.info
    angle = Block(0, np.arange(8) / 100, np.zeros(8), np.zeros(8, np.uint8), quantity="angle", unit="rad")
    run = write_run(tmp_path / "run.h5", [angle], info)
    assert cli("convert", run, tmp_path / "again.h5").code == 0
    assert springmass.load(tmp_path / "again.h5").loaded.samples.unit == "rad"
    done = cli("convert", run, tmp_path / "angle.csv")
    assert done.code == 2
    assert not (tmp_path / "angle.csv").exists()
