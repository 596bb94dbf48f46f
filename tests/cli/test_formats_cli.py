"""``springmass formats``: which families there are, and what one file is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import springmass
from acquisition.registry import formats

Cli = Callable[..., Any]


def facts_of(out: str) -> dict[str, str]:
    """Return the lines of a description, value by name; of several traps the last."""
    return dict(line.split(None, 1) for line in out.splitlines())


def test_the_list_names_every_family_and_run_files(cli: Cli) -> None:
    """One line a family, as text and as JSON."""
    done = cli("formats")
    assert done.code == 0
    names = [line.split()[0] for line in done.out.splitlines()]
    assert names == [*(family.name for family in formats()), "run"]
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


def test_a_file_of_another_family_is_named(cli: Cli, tmp_path: Path) -> None:
    """What it is, that it is not read, and what to do."""
    path = tmp_path / "run.lvm"
    path.write_bytes(b"LabVIEW Measurement\t\r\nWriter_Version\t2\r\n")
    done = cli("formats", path)
    assert done.code == 3
    assert "LVM file" in done.complaint
    assert "export time and position as text" in done.complaint


def test_a_name_that_no_terminal_can_show_is_shown_escaped(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Bytes without meaning in a file's name are no reason to fail."""
    odd = recording.rename(tmp_path / "a\udcff.txt")
    done = cli("formats", odd)
    assert done.code == 0
    assert "a\\udcff.txt" in done.out
