"""Names and titles from outside: shown with nothing hidden, in no place more than text."""

from __future__ import annotations

import csv
import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.errors import visible
from springmass.report.tables import cell
from tests.courses import short_course

Cli = Callable[..., Any]
ESCAPE = "a\x1b[2J\x07\u202egnp"
TITLE = "a\x1b]0;b\x07\u202egnp"
"""Sets a terminal's title; without a bracket, which makes a path of a table a pattern."""


def texts_of(folder: Path) -> dict[str, str]:
    """Return the content of the files of a report that are text."""
    kinds = {".html", ".csv", ".tex", ".svg"}
    return {each.name: each.read_text("utf-8") for each in folder.rglob("*") if each.suffix in kinds}


@pytest.mark.parametrize("text", ["bob", "Träger 3 µm", "a\u00a0b", ""])
def test_what_hides_nothing_is_shown_as_it_is(text: str) -> None:
    """Letters, signs and blanks of every alphabet stay."""
    assert visible(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31m", "\\x1b[31m"),
        ("a\nb\r\tc\0", "a\\nb\\r\\tc\\x00"),
        ("\u202e\u2028\ufeff", "\\u202e\\u2028\\ufeff"),
        ("\udcff", "\\udcff"),
    ],
)
def test_what_steers_is_shown_as_its_escape(text: str, shown: str) -> None:
    """Control characters, marks of direction, invisible ones and bytes that are no text."""
    assert visible(text) == shown


@pytest.mark.parametrize("text", ["=1+1", "+1+1", "-1+1", "@SUM(1)", " =1", "＝1", "=cmd|' /C calc'!A0"])
def test_a_formula_is_text_in_a_table(text: str) -> None:
    """An apostrophe in front makes it text for every spreadsheet."""
    assert cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["-3.5", "+1e-9", "bob", "3 = 3", "\\t=1"])
def test_a_number_and_a_word_are_left_alone(text: str) -> None:
    """What no spreadsheet takes for a formula stays."""
    assert cell(text) == text
    assert cell("\t=1") == "\\t=1"


def test_a_terminal_sees_no_escapes(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Of the title and the name of a file, in what is printed and in what is refused."""
    path = tmp_path / f"{ESCAPE}.txt"
    path.write_bytes(recording.read_bytes().replace(b"File", b"File \x1b]0;x\x07", 1))
    run = tmp_path / f"{ESCAPE}.h5"
    for arguments in (
        ["formats", path],
        ["convert", path, run],
        ["formats", run],
        ["analyse", run],
        ["replay", "none"],
    ):
        done = cli(*arguments, *(["--out", tmp_path] if arguments[0] == "analyse" else []))
        assert (done.out + done.err).replace("\n", "").isprintable(), arguments
    done = cli("analyse", tmp_path / f"{ESCAPE}{ESCAPE}")
    assert done.code == 3
    assert done.complaint.isprintable()


@pytest.mark.trials
@pytest.mark.parametrize("name", [ESCAPE, "=1+1", "$\\frac$", "<script>", "a & b_%", "b" * 251])
def test_a_report_of_any_name_is_a_report(cli: Cli, data: Path, tmp_path: Path, name: str) -> None:
    """Page, tables and figures are made of whatever name, and show it as text."""
    paths = [tmp_path / f"{name}.txt", tmp_path / "other.txt"]
    for path, of in zip(paths, ("undamped", "damped"), strict=True):
        shutil.copy(data / f"{of}_simulated_position.txt", path)
    scenes = [option for of in ("undamped", "damped") for option in ("--scene", data / f"{of}.scene.toml")]
    done = cli("compare", *paths, *scenes, "--out", tmp_path / "together")
    assert done.code == 0, done.err
    assert (done.out + done.err).replace("\n", "").isprintable()
    found = texts_of(tmp_path / "together")
    for file, text in found.items():
        hidden = [c for c in text if not c.isprintable() and c not in "\n\r\u00a0\u202f\u2009"]
        assert hidden == [], file
    rows = list(csv.reader((tmp_path / "together/results.csv").read_text("utf-8").splitlines()))
    assert {row[0] for row in rows[1:]} == {cell(name), "other"}
    assert found["report.html"].count("<script>") == 1  # the charts'; a name never opens another


@pytest.mark.skipif(sys.platform != "linux", reason="other systems take names of text alone")
def test_a_name_that_is_no_text_is_a_name(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Bytes that are not UTF-8, in a name of 255 bytes: a report is made, and results.json has the name."""
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + b"\xff" * 251 + b".txt"))
    path.write_bytes(recording.read_bytes())
    done = cli("analyse", path, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    (results,) = (tmp_path / "out").iterdir()
    assert "\\udcff" in (results / "results.json").read_text("utf-8")
    assert "\\udcff" in (results / "report.html").read_text("utf-8")


def test_a_course_shows_no_escapes(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of names of files and tags: in the table, the page, the catalog, the comparison and the lines of each command."""
    monkeypatch.chdir(tmp_path)
    short_course(Path("runs"), 3)
    for number in range(3):
        Path(f"runs/run{number:03d}.txt").rename(f"runs/{TITLE}{number}.txt")
    with Path("runs.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["path", "group", "spring"])
        table.writerows(
            [f"runs/{TITLE}{number}.txt", f"one\u202e\x9b{number % 2}", f"\x1b[2J{number}"] for number in range(3)
        )
    course = ["batch", "--runs", "runs.csv", "-o", "out", "--jobs", "1", "--reports", "1", "--accuracy", "fast"]
    for arguments in (
        course,
        [*course, "--rehash"],
        ["catalog", "out"],
        ["catalog", "out", "--columns", "run,group,spring,path,messages"],
        ["catalog", "out", "--json"],
        ["compare", "out"],
        ["compare", "out", "--bench", "group"],
        ["report", "out", f"{visible(TITLE)}1"],
    ):
        done = cli(*arguments)
        assert done.code == 0, done.err
        assert (done.out + done.err).replace("\n", "").isprintable(), arguments
    with Path("out/results.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == [visible(f"{TITLE}{number}") for number in range(3)]
    assert {row["group"] for row in rows} == {"one\\u202e\\x9b0", "one\\u202e\\x9b1"}
    for row in rows:
        assert "".join(row.values()).isprintable()
        assert json.loads(row["findings"] or "[]") is not None
        assert json.loads(row["messages"] or "[]") is not None
    assert [c for c in Path("out/index.html").read_text("utf-8") if not c.isprintable() and c not in "\n\u00a0"] == []


def test_the_last_lines_of_a_recording_show_no_escapes(cli: Cli, tmp_path: Path) -> None:
    """Of its name, which the lines on what was built and what to do next repeat, and those of a recovery."""
    scene = tmp_path / "bench.toml"
    scene.write_text("[bob]\nmass_kg = 0.2\n[spring]\nconstant_n_per_m = 14.0\n[start]\ndisplacement_m = 0.05\n")
    run = tmp_path / f"{ESCAPE}.h5"
    done = cli("record", "--simulate", scene, "--seconds", "1", "--title", ESCAPE, "-o", run)
    assert done.code == 0, done.err
    assert visible(run.name) in done.err
    assert (done.out + done.err).replace("\n", "").replace("\r", "").isprintable()
