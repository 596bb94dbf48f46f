"""``springmass convert``: an old recording into a run file and back, bit for bit, and nothing overwritten unasked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springmass
from acquisition.recording import Original

Cli = Callable[..., Any]


def same_samples(a: Any, b: Any) -> bool:
    """Tell whether two blocks hold the same values, bit for bit."""
    pairs = [(getattr(a, name), getattr(b, name)) for name in ("t", "distance", "flags", "velocity", "host_ns")]
    return all((x is None) == (y is None) and (x is None or x.tobytes() == y.tobytes()) for x, y in pairs)


def test_the_original_comes_back_bit_for_bit(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Text into a run file, and the text out of it under a name of one's own."""
    old, run, back = data / "clipped_simulated_position.txt", tmp_path / "run.h5", tmp_path / "back.txt"
    done = cli("convert", old, run)
    assert (done.code, done.out) == (0, "")
    assert done.complaint.startswith(f"{run}: ")
    assert cli("convert", run, back).code == 0
    assert back.read_bytes() == old.read_bytes()
    with springmass.open_run(run) as file:
        file.verify()
        assert same_samples(file.samples(), springmass.load(old).samples)
        assert (file.format, file.info.kind) == ("motion-sensor", "simulated")
        assert [trap.code for trap in file.traps] == [trap.code for trap in springmass.load(old).traps]


def test_a_pair_comes_back_into_a_folder(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Both files of a pair travel inside, under their own names."""
    names = [f"undamped_simulated_{what}.txt" for what in ("position", "velocity")]
    run, folder = tmp_path / "run.h5", tmp_path / "back"
    folder.mkdir()
    assert cli("convert", data / names[0], run, "--velocity", data / names[1]).code == 0
    assert cli("convert", run, folder).code == 0
    assert sorted(path.name for path in folder.iterdir()) == names
    assert all((folder / name).read_bytes() == (data / name).read_bytes() for name in names)
    with springmass.open_run(run) as file:
        velocity = file.samples().velocity
    assert velocity is not None
    assert np.isfinite(velocity).sum() > 900


def test_a_pair_needs_a_folder(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Two originals do not fit into one name."""
    position, velocity = (data / f"undamped_simulated_{what}.txt" for what in ("position", "velocity"))
    assert cli("convert", position, tmp_path / "run.h5", "--velocity", velocity).code == 0
    done = cli("convert", tmp_path / "run.h5", tmp_path / "back.txt")
    assert done.code == 2
    assert "2 originals travel inside" in done.complaint
    assert "name an existing folder" in done.complaint


def test_a_pair_of_one_name_comes_back_under_two(cli: Cli, data: Path, tmp_path: Path) -> None:
    """Position and velocity are often both called data.txt, in folders of their own."""
    whole = {}
    for what in ("position", "velocity"):
        (tmp_path / what).mkdir()
        whole[what] = (data / f"undamped_simulated_{what}.txt").read_bytes()
        (tmp_path / what / "data.txt").write_bytes(whole[what])
    run, folder = tmp_path / "run.h5", tmp_path / "back"
    folder.mkdir()
    velocity = tmp_path / "velocity" / "data.txt"
    assert cli("convert", tmp_path / "position" / "data.txt", run, "--velocity", velocity).code == 0
    assert cli("convert", run, folder).code == 0
    assert (folder / "data.txt").read_bytes() == whole["position"]
    assert (folder / "data-2.txt").read_bytes() == whole["velocity"]


def test_an_original_chooses_no_folder(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A name from outside that climbs out of the folder keeps its last part alone."""
    loaded = springmass.load(recording)
    run = springmass.write_run(
        tmp_path / "run.h5", [loaded.samples], loaded.info, originals=[Original("../../escaped.txt", b"x")]
    )
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


def test_of_a_pair_both_are_given_back_or_none(cli: Cli, data: Path, tmp_path: Path) -> None:
    """One of two names is taken: nothing is written beside it."""
    position, velocity = (data / f"undamped_simulated_{what}.txt" for what in ("position", "velocity"))
    folder = tmp_path / "back"
    folder.mkdir()
    (folder / velocity.name).write_bytes(b"mine")
    assert cli("convert", position, tmp_path / "run.h5", "--velocity", velocity).code == 0
    done = cli("convert", tmp_path / "run.h5", folder)
    assert done.code == 2
    assert "--overwrite" in done.complaint
    assert [path.read_bytes() for path in folder.iterdir()] == [b"mine"]


def test_a_run_file_converts_to_one_that_says_the_same(cli: Cli, data: Path, tmp_path: Path) -> None:
    """A scene put in, samples, originals, traps, family and origin survive the way through a second run file."""
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    old = springmass.load(data / "undamped_simulated_position.txt")
    springmass.write_run(
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
    with springmass.open_run(first) as a, springmass.open_run(second) as b:
        assert same_samples(a.samples(), b.samples())
        assert (a.info, a.title, a.traps, a.format) == (b.info, b.title, b.traps, b.format)
        assert a.originals() == b.originals()
        assert dict(b.provenance) | dict(a.provenance) == b.provenance
        assert b.scene == springmass.read_scene(data / "undamped.scene.toml").to_mapping()


def test_other_suffixes_are_refused(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A recording becomes a run file and nothing else."""
    done = cli("convert", recording, tmp_path / "run.csv")
    assert done.code == 2
    assert "got .csv" in done.complaint
    assert cli("convert", recording, tmp_path / "run").complaint.endswith("got no suffix")


def test_a_run_without_originals_has_nothing_to_give_back(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """That is said, not an empty file written."""
    loaded = springmass.load(recording)
    run = springmass.write_run(tmp_path / "live.h5", [loaded.samples], loaded.info)
    done = cli("convert", run, tmp_path / "back.txt")
    assert done.code == 3
    assert "no original file travels inside" in done.complaint
    assert not (tmp_path / "back.txt").exists()


def test_an_empty_run_is_converted_too(cli: Cli, tmp_path: Path, recording: Path) -> None:
    """A run stopped before its first sample still gives back what travels inside; only analysing it fails."""
    info = springmass.load(recording).info
    run = springmass.write_run(tmp_path / "run.h5", [], info, originals=[Original("a.txt", b"header\n")])
    assert cli("convert", run, tmp_path / "back.txt").code == 0
    assert (tmp_path / "back.txt").read_bytes() == b"header\n"
    assert cli("formats", run).code == 0
    done = cli("analyse", "--json", run)
    assert (done.code, done.out) == (3, "")
    assert str(run) in done.complaint
    assert "the record holds no sample" in cli("analyse", "--json", "--from", "1", run).complaint


def test_a_folder_that_is_missing_is_a_usage_error(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The line says to make it."""
    done = cli("convert", recording, tmp_path / "absent" / "run.h5")
    assert done.code == 2
    assert "make the folder first" in done.complaint


@pytest.mark.parametrize("option", [("--rate-hz", "100"), ("--unit", "cm"), ("--channel", "distance")])
def test_a_run_file_needs_no_answers(cli: Cli, recording: Path, tmp_path: Path, option: tuple[str, str]) -> None:
    """What completes a text is refused where the file says it all."""
    assert cli("convert", recording, tmp_path / "run.h5").code == 0
    done = cli("convert", tmp_path / "run.h5", tmp_path / "back.txt", *option)
    assert done.code == 2
    assert "a run file holds all of them" in done.complaint
