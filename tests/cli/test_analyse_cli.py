"""``springmass analyse``: one line of JSON per input, and exit codes that tell what happened."""

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import springmass
from storage.run_file.writing import write_run
from tests.cli.conftest import Cli

FILES = [f"{name}_simulated_position.txt" for name in ("undamped", "damped", "clipped")]


def test_a_stated_mass_changes_no_distance(cli: Cli, tmp_path: Path) -> None:
    """A plain table keeps its u of the rest position; a sensor in its scene adds the temperature."""
    t = np.arange(1500) / 100
    y = 0.25 + 0.05 * np.exp(-0.01 * t) * np.cos(8.0 * t) + 1e-4 * np.random.default_rng(3).standard_normal(t.size)
    table = tmp_path / "table.csv"
    table.write_text("time (s),distance (m)\n" + "".join(f"{a:.2f},{b:.6f}\n" for a, b in zip(t, y, strict=True)))
    scene = tmp_path / "sensor.toml"
    scene.write_text('[sensor]\nposition = "below"\n')

    def u(*options: str | Path) -> float:
        (result,) = cli("analyse", "--json", table, *options).results
        return float(result["estimates"]["offset"]["u"])

    assert u("--mass-kg", "0.2") == u() < 1e-5
    assert u("--scene", scene, "--mass-kg", "0.2") == pytest.approx(u("--scene", scene))
    assert u("--scene", scene) == pytest.approx(0.25 * 0.0055, rel=0.02)


def test_a_run_file_with_an_impossible_scene_fails_alone(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The scene inside a run file belongs to that input; its error names the file."""
    run = springmass.load(recording).loaded
    bad = write_run(tmp_path / "bad.h5", [run.samples], run.info, scene={"bob": {"mass_kg": -1.0}})
    done = cli("analyse", "--json", bad, recording)
    assert (done.code, len(done.results)) == (1, 1)
    assert "bad.h5" in done.complaint
    assert cli("analyse", "--json", bad).code == 3


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 20_000,
        "[bob]\nmass_kg = '" + "x" * 1_000_000 + "'\n",
        "[bob]\nmass_kg = " + "9" * 5000 + "\n",
        '["\\u001b[31m"]\na = 1\n',
        "# H\udcf6he\n",
    ],
)
def test_an_impossible_scene_is_one_line(cli: Cli, recording: Path, tmp_path: Path, text: str) -> None:
    """Exit code 2 and a line that names the file, before any input is read."""
    scene = tmp_path / "bench.toml"
    scene.write_text(text, "utf-8", "surrogateescape")
    done = cli("analyse", "--json", recording, "--scene", scene)
    assert (done.code, done.out) == (2, "")
    assert str(scene) in done.complaint
    assert done.complaint.isprintable()
    assert len(done.complaint) < 1000


@pytest.mark.parametrize("count", [1, 2])
def test_a_folder_that_cannot_be_made_costs_one_line(cli: Cli, recording: Path, count: int) -> None:
    """A file stands where the results should go: the results are printed, one line says so, exit code 2."""
    done = cli("analyse", *[recording] * count, "--output", recording)
    assert done.code == 2
    assert "0.7585" in done.out
    assert str(recording) in done.complaint


def test_the_module_runs_as_a_program(recording: Path, tmp_path: Path) -> None:
    """``python -m springmass`` elsewhere, in a separate process: JSON on stdout, the exit code of the command."""
    command = [sys.executable, "-W", "error", "-m", "springmass", "analyse", "--json"]
    done = subprocess.run(
        [*command, str(recording), "absent.txt"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert json.loads(done.stdout)["estimates"]["period"]["value"] == pytest.approx(0.7585, abs=5e-4)
    assert done.stderr.startswith("springmass: absent.txt: cannot be opened")
    assert len(done.stderr.splitlines()) == 1


def test_nothing_steers_the_terminal(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Control characters, marks of direction and bytes that are no text are shown as their escapes."""
    path = tmp_path / "a\x1b[2J\x07\u202egnp\n\udcff.txt"
    path.write_bytes(recording.read_bytes().replace(b"File", b"File \x1b]0;x\x07", 1))
    for arguments in (["formats", path], ["analyse", path, "--no-report"], ["analyse", path, tmp_path / "\x1b"]):
        done = cli(*arguments)
        assert (done.out + done.err).replace("\n", "").isprintable(), arguments
    assert "\\udcff" in cli("analyse", "--json", path.with_suffix(".none")).complaint


def test_standard_input_is_read(cli: Cli, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A dash stands for it; the numbers are those of the file."""
    path = data / FILES[0]
    (expected,) = cli("analyse", path, "--json").results
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(path.read_bytes())))
    (result,) = cli("analyse", "-", "--json").results
    assert result["estimates"] == expected["estimates"]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"hello")))
    assert cli("analyse", "-", "--json").complaint.startswith("springmass: <stdin>: ")


@pytest.mark.parametrize(
    ("option", "names"),
    [
        ("channel", ("位置", "高度")),
        ("channel", ("a/b", "a:b")),
        ("channel", ("x" * 70 + "1", "x" * 70 + "2")),
        ("channel", ("?", "!")),
        ("run", ("Run 1", "Run 2")),
    ],
)
def test_channels_and_runs_have_their_own_results_whatever_their_names(
    cli: Cli, tmp_path: Path, option: str, names: tuple[str, str]
) -> None:
    """Names in other scripts, with signs that no file name has, or longer than a file name may be stay distinct."""
    t = np.arange(1000) / 100
    x, y = (0.2 + 0.05 * np.cos(omega * t) for omega in (8.0, 9.0))
    columns = (t, x, y) if option == "channel" else (t, x, t, y)
    headings = [f"{name} (m)" if option == "channel" else f"{name}: Time (s),{name}: Position (m)" for name in names]
    rows = "\n".join(",".join(f"{each:.5f}" for each in row) for row in zip(*columns, strict=True))
    head = ",".join(["time (s)", *headings] if option == "channel" else headings)
    (tmp_path / "bob.csv").write_text(f"{head}\n{rows}\n", "utf-8")
    for name in names:
        done = cli("analyse", tmp_path / "bob.csv", f"--{option}", name, "--accuracy", "fast", "-o", tmp_path)
        assert done.code == 0, done.err
    results = [json.loads(each.read_text("utf-8")) for each in tmp_path.glob("*/results.json")]
    assert {each["provenance"]["parameters"][option] for each in results} == {*names}
