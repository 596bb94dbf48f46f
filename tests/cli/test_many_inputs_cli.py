"""Several inputs: one Table 1 and one report; folders of recordings."""

import shutil
from pathlib import Path

import pytest

from springmass.loading.load import sample_data
from tests.cli.conftest import Cli
from tests.courses import contents


@pytest.fixture
def bench(tmp_path: Path, data: Path) -> Path:
    """Return a folder as a bench leaves it: two pairs of files, notes, a scene, and a sub-folder."""
    folder = tmp_path / "bench"
    (folder / "old").mkdir(parents=True)
    for name in ("undamped", "damped"):
        for kind in ("position", "velocity"):
            file = f"{name}_simulated_{kind}.txt"
            (folder / file).write_bytes((data / file).read_bytes())
    (folder / "notes.md").write_text("Two runs, the disc on the second.\n")
    (folder / "bench.toml").write_text("[bob]\nmass_kg = 0.2\n")
    return folder


def test_several_inputs_share_one_table_and_one_report(cli: Cli, bench: Path, tmp_path: Path) -> None:
    """A column a run, a row a run and quantity, one page that shows both."""
    runs = [bench / f"{name}_simulated_position.txt" for name in ("undamped", "damped")]
    done = cli("analyse", *runs, "--output", tmp_path / "out")
    assert done.code == 0
    _, _, *body = done.out.splitlines()
    (period,) = (line for line in body if line.startswith("period"))
    assert "0.7585" in period
    assert "0.7900" in period
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["together.results"]
    page = (tmp_path / "out" / "together.results" / "report.html").read_text("utf-8")
    assert all(run.stem in page for run in runs)
    rows = (tmp_path / "out" / "together.results" / "results.csv").read_text("utf-8").splitlines()
    assert {row.partition(",")[0] for row in rows[1:]} == {run.stem for run in runs}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("inside", [False, True])
def test_a_report_of_other_runs_keeps_no_file_of_the_earlier_runs(
    cli: Cli, bench: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside: bool
) -> None:
    """Tables and figures of the earlier runs go; files of a person stay, and a folder that somebody stands in too."""
    a, b, c, d = (bench / f"{name}.txt" for name in "abcd")
    for run in (a, b, c, d):
        shutil.copy(sample_data() / "cropped_simulated_position.txt", run)
    options = ("--accuracy", "fast", "--output", tmp_path)
    assert cli("analyse", a, b, *options, "--figures", "svg").code == 0
    folder = tmp_path / "together.results"
    earlier = set(contents(folder))
    assert {"a_motion.csv", "figures/a_position.svg"} <= earlier
    if inside:
        monkeypatch.chdir(folder)
    else:
        (folder / "my_motion.csv").write_text("t,y\n")
    assert cli("analyse", c, d, *options).code == 0
    left = set(contents(Path() if inside else folder))
    assert {"c_motion.csv"} if inside else {"c_motion.csv", "my_motion.csv"} <= left
    assert {path.name for path in tmp_path.iterdir()} == {"bench", folder.name}
    assert not [name for name in left & earlier if "a_" in name or "b_" in name or name.startswith("figures/")]


def test_a_folder_gives_its_recordings_and_names_what_is_none(cli: Cli, bench: Path) -> None:
    """The velocity files join their positions; what no family knows is counted and named, folders are left alone."""
    done = cli("analyse", bench, "--json")
    assert done.code == 0
    assert [Path(result["input"]["path"]).name for result in done.results] == [
        "damped_simulated_position.txt",
        "undamped_simulated_position.txt",
    ]
    velocities = [result["provenance"]["parameters"]["velocity"] for result in done.results]
    assert velocities == [str(bench / f"{name}_simulated_velocity.txt") for name in ("damped", "undamped")]
    assert all(word in done.complaint for word in ("2 recordings", "bench.toml", "notes.md"))


def test_a_folder_without_a_recording_is_refused(cli: Cli, bench: Path) -> None:
    """Exit code 3, and what is there."""
    (bench / "old" / "readme.md").write_text("nothing")
    done = cli("analyse", bench / "old", "--json")
    assert (done.code, done.out) == (3, "")
    assert "readme.md" in done.complaint
