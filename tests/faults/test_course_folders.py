"""Folders of courses that were damaged or made by hand: each command ends with lines and an exit code."""

from __future__ import annotations

import csv
import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from springmass.cli import main
from springmass.errors import INTERNAL, OK, SOME_FAILED, UNREADABLE, USAGE
from tests.courses import short_course

COMMANDS = (
    ("catalog", "out", "--rebuild"),
    ("catalog", "out", "--rebuild", "--where", "period > 0", "--json"),
    ("compare", "out"),
    ("map", "out", "--out", "maps"),
    ("report", "out", "run000"),
    ("batch", "runs", "-o", "out", "--jobs", "1", "--reports", "0", "--accuracy", "fast"),
)


def cells(column: str, value: str) -> Callable[[Path], None]:
    """Return a function that puts a value into a column of the table."""

    def damage(out: Path) -> None:
        with (out / "results.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        with (out / "results.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows({**row, column: value} for row in rows)

    return damage


def content(name: str, data: bytes) -> Callable[[Path], None]:
    """Return a function that writes a file of the folder anew."""
    return lambda out: (out / name).write_bytes(data) and None


def part(**changes: object) -> Callable[[Path], None]:
    """Return a function that changes fields of the rows that tables are made of."""

    def damage(out: Path) -> None:
        whole = out / "parts" / "whole.jsonl"
        rows = [{**json.loads(line), **changes} for line in whole.read_text("utf-8").splitlines()]
        whole.write_text("".join(f"{json.dumps(row)}\n" for row in rows), "utf-8")

    return damage


def folder_for(name: str) -> Callable[[Path], None]:
    """Return a function that puts a folder in place of a file."""

    def damage(out: Path) -> None:
        (out / name).unlink()
        (out / name).mkdir()

    return damage


DAMAGES = {
    "an empty table": content("results.csv", b""),
    "a table of zeros": content("results.csv", bytes(2000)),
    "a table that is no UTF-8": content("results.csv", b"run,status\n\xff\xfe,ok\n"),
    "a head alone": lambda out: (
        (out / "results.csv").write_text((out / "results.csv").read_text("utf-8").splitlines()[0] + "\n", "utf-8")
        and None
    ),
    "a table of others": content("results.csv", b"a,b\n1,2\n"),
    "a quote that stays open": content("results.csv", b'run,status\n"run000,ok\n'),
    "a field of a megabyte": content("results.csv", b"run,status\n" + b"x" * 1_000_000 + b",ok\n"),
    "a word for a number": cells("period", "long"),
    "a fraction for a whole number": cells("samples", "2.5"),
    "an infinite number": cells("period", "inf"),
    "no status": cells("status", ""),
    "no unit": cells("unit", ""),
    "no course": cells("run", ""),
    "findings that are no JSON": cells("findings", "{"),
    "findings that are a number": cells("findings", "5"),
    "points that are no JSON": cells("drag_points", "[[1,"),
    "points that are words": cells("drag_points", '[["a", "b", "c", "d"]]'),
    "points that are a number": cells("drag_points", "5"),
    "points of two numbers": cells("drag_points", "[[1, 2]]"),
    "a table that is a folder": folder_for("results.csv"),
    "rows that are none": content("parts/whole.jsonl", b"{\n[]\n5\nnull\n\xff\n"),
    "rows that are nested": content("parts/whole.jsonl", b"[" * 100_000),
    "rows that are a folder": folder_for("parts/whole.jsonl"),
    "a row of a job alone": content("parts/whole.jsonl", b'{"job": {"path": "run", "answers": {}}}\n'),
    "a row without a job": part(job=None),
    "a row with another job": part(job={"path": 5, "answers": []}),
    "a row without estimates": part(estimates=None),
    "a row with other estimates": part(estimates={"period": 5}),
    "a row with another status": part(status=5),
    "a row without messages": part(messages=[["warning"]]),
    "stamps that are none": part(stamps=5),
    "a part that is damaged": content("parts/part-0123456789abcdef.jsonl", b'{"job": 5}\n'),
    "a mark that is none": content("parts/complete.json", b"[" * 10_000),
    "no parts": lambda out: shutil.rmtree(out / "parts"),
}


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recordings and their course, without the Parquet, which would be read first."""
    top = tmp_path_factory.mktemp("course")
    short_course(top / "runs", 2)
    assert main(["batch", str(top / "runs"), "-o", str(top / "out"), *COMMANDS[-1][4:]]) == OK
    (top / "out" / "results.parquet").unlink(missing_ok=True)
    return top


def assert_answers(capsys: pytest.CaptureFixture[str]) -> None:
    """Every command ends with an exit code of the program, and says why in lines."""
    for command in COMMANDS:
        code = main(list(command))
        err = capsys.readouterr().err
        assert code in (OK, SOME_FAILED, USAGE, UNREADABLE, INTERNAL), command
        assert "Traceback" not in err, command
        if code:
            assert err.startswith("springmass: ") or "\nspringmass: " in err, command


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_course_is_answered(course, tmp_path, monkeypatch, capsys, damage):
    """Whatever is damaged, no command ends with a traceback."""
    shutil.copytree(course, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    damage(tmp_path / "out")
    assert_answers(capsys)


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + bytes(1000) + b"PAR1", bytes(3000)])
def test_a_damaged_parquet_is_answered(course, tmp_path, monkeypatch, capsys, data):
    """The table that is read first may be damaged, too."""
    shutil.copytree(course, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "out" / "results.parquet").write_bytes(data)
    assert_answers(capsys)
