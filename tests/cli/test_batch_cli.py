"""``springmass batch``: one table of many runs, made the same on every way."""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import springmass
from springmass.layout import PACKAGES
from tests.courses import bad_files, contents, damped, rows_of, short_course, write_recording
from tests.sampling import sampled

ROOT = Path(__file__).parents[2]
MANY = 2600 if os.environ.get("SPRINGMASS_TRIALS") else 26  # a hundred for each bad one
QUICK = ("--reports", "0", "--accuracy", "fast")


@pytest.fixture(scope="module")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six recordings that no test changes."""
    return short_course(tmp_path_factory.mktemp("shelf") / "runs", 6)


@pytest.fixture
def runs(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six recordings; the test stands next to their folder."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(shelf, tmp_path / "runs").name)


def test_a_folder_becomes_a_table_a_page_and_reports(runs, cli):
    """One row a run, reports of the worst, and a frame in Python."""
    done = cli("batch", runs, "-o", "out", "--jobs", "1", "--reports", "1")
    assert done.code == 0
    table = rows_of("out/results.csv")
    assert [row["run"] for row in table] == [f"run{i:03d}" for i in range(6)]
    (report,) = Path("out/reports").glob("*/report.html")
    page = Path("out/index.html").read_text()
    assert f'href="{report.relative_to("out").as_posix()}"' in page
    assert page.count("<svg") == 6
    frame = springmass.results("out")
    assert [str(value) for value in frame["period"]] == [row["period"] for row in table]


def test_a_second_pass_analyses_nothing_and_a_change_only_what_changed(runs, cli):
    """What was touched is kept; another content, scene or accuracy is analysed; an edited table is written again."""
    command = ("batch", runs, "-o", "out", "--jobs", "1", *QUICK)
    cli(*command)
    before = contents(Path("out"))
    assert "6 unchanged, 0 analysed" in cli(*command).err
    assert contents(Path("out")) == before
    os.utime(runs / "run001.txt", ns=(1, 1))
    Path("out/results.csv").write_text("edited")
    assert "6 unchanged, 0 analysed" in cli(*command).err
    assert contents(Path("out")) == before
    shutil.copy(runs / "run000.txt", runs / "run005.txt")
    assert "5 unchanged, 1 analysed" in cli(*command).err
    table = rows_of("out/results.csv")
    assert table[5]["period"] == table[0]["period"]
    assert "0 unchanged, 6 analysed" in cli(*command[:-1], "standard").err
    (runs / "run003.about.toml").write_text("[scene.bob]\nmass_kg = 0.2\n")
    assert "5 unchanged, 1 analysed" in cli(*command[:-1], "standard").err
    assert rows_of("out/results.csv")[3]["bob_mass_kg"] == "0.2"


@pytest.mark.trials
@pytest.mark.skipif(shutil.which("git") is None, reason="a change of a checkout is noticed by git")
def test_a_changed_program_analyses_all_runs(runs, tmp_path):
    """In a checkout the table names the commit and an uncommitted change, and either makes the rows old."""
    checkout = tmp_path / "checkout"
    for package in ("springmass", *PACKAGES):
        shutil.copytree(ROOT / package, checkout / package, ignore=shutil.ignore_patterns("__pycache__"))

    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        subprocess.run(["git", "-C", checkout, *who, *words], check=True, capture_output=True)

    def done() -> tuple[str, str]:
        command = [sys.executable, "-m", "springmass", "batch", runs / "run000.txt", "-o", "out", *QUICK]
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        program = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        (row,) = rows_of("out/results.csv")
        return re.findall(r"\d un.*analysed", program.stderr)[0], row["software"]

    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "first")
    said, first = done()
    assert said == "0 unchanged, 1 analysed"
    assert first.startswith(f"springmass {springmass.__version__}+")
    assert done() == ("1 unchanged, 0 analysed", first)
    with (checkout / "pipeline/analyse.py").open("a") as file:
        file.write("# a change\n")
    said, changed = done()
    assert said == "0 unchanged, 1 analysed"
    assert changed.startswith(f"{first.partition(',')[0]}.")
    assert done() == ("1 unchanged, 0 analysed", changed)
    git("commit", "-q", "-a", "-m", "second")
    said, second = done()
    assert said == "0 unchanged, 1 analysed"
    assert len({first, changed, second}) == 3


@pytest.mark.parametrize("reports", sampled(["0", "1"], 1))
def test_two_processes_give_the_bytes_of_one(runs, cli, reports):
    """The files of a course, its reports among them, do not depend on who analysed its runs."""
    folders = []
    for jobs in ("1", "2"):
        out = Path(jobs) / "out"
        out.parent.mkdir()
        assert cli("batch", runs, "-o", out, "--jobs", jobs, "--reports", reports, "--accuracy", "fast").code == 0
        folders.append(contents(out))
    assert folders[0] == folders[1]
    assert any(name.endswith("report.html") for name in folders[0]) == (reports == "1")


@pytest.mark.parametrize("good", [6, pytest.param(MANY, marks=pytest.mark.trials)])
def test_bad_files_fail_alone(tmp_path, monkeypatch, cli, good):
    """Exit code 1; each failure is one line and a row; the others are equal to those of a pass without it."""
    monkeypatch.chdir(tmp_path)
    runs = Path(short_course(tmp_path / "runs", good).name)
    inputs = [str(path) for path in sorted(runs.iterdir())]
    assert cli("batch", *inputs, "-o", "good", "--jobs", "1", *QUICK).code == 0
    bad = bad_files(runs)
    done = cli("batch", *inputs, *bad, "-o", "bad", "--jobs", "1", *QUICK)
    assert done.code == 1
    assert f"{good + len(bad)} runs: 0 unchanged, {good + len(bad)} analysed, {len(bad)} failed" in done.err
    assert "defect of the program" not in done.err
    table = rows_of("bad/results.csv")
    failed = [row for row in table if row["status"] != "ok"]
    assert sorted(row["path"] for row in failed) == sorted(bad)
    for row in failed:
        assert row["path"] in row["error"]
        assert done.err.splitlines().count(f"springmass: {row['error']}") == 1
    assert [row for row in table if row["status"] == "ok"] == rows_of("good/results.csv")
    done = cli("batch", *inputs, *bad, "-o", "bad", "--jobs", "1", *QUICK)
    assert done.code == 1  # still
    assert f"{good + len(bad)} unchanged, 0 analysed, {len(bad)} failed" in done.err


def test_patterns_and_folders_in_folders_are_inputs(runs, cli):
    """A pattern finds files, folders are looked into; a file that several name is one run."""
    (runs / "late").mkdir()
    shutil.copy(runs / "run000.txt", runs / "late" / "run000.txt")
    cli("batch", "runs/late/run000.txt", "runs/run001.txt", "runs/run00[12].txt", "-o", "some", "--jobs", "1", *QUICK)
    assert [row["run"] for row in rows_of("some/results.csv")] == ["late/run000", "run001", "run002"]
    cli("batch", runs, "-o", "out", "--jobs", "1", *QUICK)
    assert len(rows_of("out/results.csv")) == 7


def test_runs_csv_gives_scenes_and_tags(runs, cli):
    """Values by path and by pattern; what fits nothing on either side is named before work begins."""
    Path("runs.csv").write_text(
        "path;bob_mass_kg;bob_mass_kg_u;spring_mass_kg;group\n"
        "run*.txt;;;0,010;\nruns/run001.txt;0,2176;0,00005;;A\nruns/run002.txt;0,2000;;;B\ngone.txt;0,2;;;\n"
    )
    done = cli("batch", runs, "--runs", "runs.csv", "-o", "out", "--jobs", "1", *QUICK)
    assert done.code == 0
    assert "runs.csv, line 5: gone.txt: no file of the inputs belongs to this row" in done.err
    table = rows_of("out/results.csv")
    assert [row["group"] for row in table][:3] == ["", "A", "B"]
    assert table[1]["bob_mass_kg_u"] == "5e-05"
    assert {row["spring_mass_kg"] for row in table} == {"0.01"}
    bench = ("--mass-kg", "0.2176+/-0.00005", "--set", "spring.mass_kg=0.01")
    (alone,) = cli("analyse", "--json", "runs/run001.txt", "--accuracy", "fast", *bench).results
    assert float(table[1]["spring_constant"]) == alone["estimates"]["spring_constant"]["value"]


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ("path,bob_mas_kg\n", "bob_mass_kg"),
        ("file,group\n", "path"),
        ("path,period\n", "'period'"),
        ("path,bob_mass_kg\nruns/run001.txt,heavy\n", "line 2: bob_mass_kg"),
        ("path,bob_mass_kg\nruns/run001.txt,-1\n", "mass_kg"),
        ("path,group\nrun*,A\n*1.txt,B\n", "run001.txt"),
    ],
)
def test_a_wrong_table_is_one_line(runs, cli, table, named):
    """The line names column, line or value, and nothing is analysed."""
    Path("runs.csv").write_text(table)
    done = cli("batch", runs, "--runs", "runs.csv", "-o", "out")
    assert done.code == 2
    assert named in done.err.splitlines()[-1]
    assert not Path("out/results.csv").exists()


def test_patterns_of_a_table_in_a_folder_with_brackets_match(runs, cli):
    """Brackets in the name of the table's folder are no part of its patterns."""
    folder = Path("lab [1]")
    shutil.copytree(runs, folder / "runs")
    (folder / "runs.csv").write_text("path,group\nruns/run00[01].txt,7\n./runs/../runs/*5.txt,8\nrun003*,9\n")
    done = cli("batch", folder / "runs", "--runs", folder / "runs.csv", "-o", "out", "--jobs", "1", *QUICK)
    assert done.code == 0
    assert [row["group"] for row in rows_of("out/results.csv")] == ["7", "7", "", "9", "", "8"]


def test_two_passes_do_not_share_a_folder(runs, cli):
    """The second pass is refused while the first one runs; the message names the process of the first."""
    cli("batch", runs, "-o", "out", "--jobs", "1", *QUICK)
    before = contents(Path("out"))
    holder = Path("out/course.lock").read_text()
    assert f"process {os.getpid()} on " in holder
    with Path("out/course.lock").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = cli("batch", runs, "-o", "out", "--jobs", "1", "--reports", "0")
    assert (done.code, contents(Path("out"))) == (2, before)
    assert "out: in use by" in done.complaint
    assert holder in done.complaint


def test_a_name_with_brackets_is_no_pattern_and_one_like_a_formula_is_text(runs, cli):
    """Rows of a table find both; the second is quoted in the results, behind blanks too, and whole in Python."""
    (runs / "run000.txt").rename(runs / "run [1].txt")
    (runs / "run001.txt").rename(runs / " =1+1.txt")
    Path("runs.csv").write_text("path,bob_mass_kg\nruns/run [1].txt,0.2\nruns/ =1+1.txt,0.3\n", encoding="utf-8")
    assert cli("batch", "--runs", "runs.csv", "-o", "out", "--jobs", "1", *QUICK).code == 0
    assert {row["run"]: row["bob_mass_kg"] for row in rows_of("out/results.csv")} == {"run [1]": "0.2", "' =1+1": "0.3"}
    assert " =1+1" in list(springmass.results("out")["run"])


def test_files_of_a_person_stay_among_the_reports(runs, cli):
    """A changed run gets its report anew; what batch did not write stays, and an old report without such goes."""
    assert cli("batch", runs, "-o", "out", "--jobs", "1", "--reports", "6", "--accuracy", "fast").code == 0
    folders = sorted(path.name for path in Path("out/reports").iterdir())
    notes = Path("out/reports", folders[0], "my-notes.md")
    notes.write_text("the clamp was loose")
    Path(runs, "run005.txt").unlink()
    shutil.copy(Path(runs, "run001.txt"), Path(runs, "run002.txt"))
    assert cli("batch", runs, "-o", "out", "--jobs", "1", "--reports", "6", "--accuracy", "fast").code == 0
    assert notes.read_text() == "the clamp was loose"
    assert sorted(path.name for path in Path("out/reports").iterdir()) == folders[:5]


def test_a_report_stays_that_of_its_recording(runs, cli):
    """Two recordings have one stem; without the first, its name is that of the second, and its report is not."""
    for name in ("run001.txt", "run002.txt", "run003.txt", "run004.txt", "run005.txt"):
        (runs / name).unlink()
    shutil.copy(runs / "run000.txt", runs / "run000.csv")
    command = ("batch", runs, "-o", "out", "--jobs", "1", "--accuracy", "fast")
    assert cli(*command).code == 0
    (runs / "run000.csv").unlink()
    assert "1 unchanged, 0 analysed" in cli(*command).err
    (link,) = re.findall(r'href="(reports/[^"]*)"', Path("out/index.html").read_text())
    assert json.loads((Path("out") / link).with_name("results.json").read_text())["input"]["path"] == "runs/run000.txt"


def test_only_the_report_of_a_changed_run_is_written_again(runs, cli):
    """A course that is continued leaves the other reports as they are."""
    call = ["batch", runs, "-o", "out", "--jobs", "1"]
    assert cli(*call).code == 0
    before = {page: page.stat().st_mtime_ns for page in Path("out").glob("reports/*/report.html")}
    assert len(before) == 6
    write_recording(Path(runs) / "run001.txt", damped(9, omega=8.05))
    assert cli(*call).code == 0
    assert {page.parent.name[:6] for page, written in before.items() if page.stat().st_mtime_ns != written} == {
        "run001"
    }
