"""Folders of courses that were damaged or made by hand: each command ends with lines and an exit code."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import springmass
from springmass.cli import main
from springmass.errors import OK, UNREADABLE, USAGE, ProgramError
from tests.courses import short_course

READERS = (
    ("catalog", "out", "--where", "period > 0", "--json"),
    ("compare", "out"),
)
BATCH = ("batch", "runs", "-o", "out", "--jobs", "1", "--reports", "0", "--accuracy", "fast")
LISTING = "parts/course.json"
Damage = Callable[[Path], object]


def rows_of(out: Path) -> list[dict[str, Any]]:
    """Return the rows of a course's only part."""
    (part,) = (out / "parts").glob("*.jsonl")
    return [json.loads(line) for line in part.read_text("utf-8").splitlines()]


def put_part(out: Path, data: bytes) -> None:
    """Put a part in place of the only one, under the name of its digest, and list it."""
    (part,) = (out / "parts").glob("*.jsonl")
    part.unlink()
    name = f"rows-{hashlib.sha256(data).hexdigest()}.jsonl"
    (out / "parts" / name).write_bytes(data)
    listing = json.loads((out / LISTING).read_text("utf-8"))
    (out / LISTING).write_text(json.dumps({**listing, "parts": [name]}), "utf-8")


def part(data: bytes) -> Damage:
    """Return a function that puts another part in place."""
    return lambda out: put_part(out, data)


def put_value(out: Path, keys: Sequence[str], value: object) -> None:
    """Put a value into every row, in the table that the keys lead to."""
    rows = rows_of(out)
    for row in rows:
        table = row
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] = value
    put_part(out, "".join(f"{json.dumps(row)}\n" for row in rows).encode("utf-8", "backslashreplace"))


def row(keys: str, value: object) -> Damage:
    """Return a function that puts a value into every row."""
    return lambda out: put_value(out, keys.split("."), value)


def listing(**changes: object) -> Damage:
    """Return a function that changes the listing."""

    def damage(out: Path) -> None:
        before = json.loads((out / LISTING).read_text("utf-8"))
        (out / LISTING).write_text(json.dumps({**before, **changes}), "utf-8")

    return damage


def content(name: str, data: bytes) -> Damage:
    """Return a function that writes a file of the folder anew."""
    return lambda out: (out / name).write_bytes(data)


def folder_for(pattern: str) -> Damage:
    """Return a function that puts a folder in place of a file."""

    def damage(out: Path) -> None:
        (path,) = out.glob(pattern)
        path.unlink()
        path.mkdir()

    return damage


def cut(pattern: str) -> Damage:
    """Return a function that cuts the end of a file."""

    def damage(out: Path) -> None:
        (path,) = out.glob(pattern)
        path.write_bytes(path.read_bytes()[:-20])

    return damage


OUTSIDE = {
    "an empty table": content("results.csv", b""),
    "another table": content("results.csv", b"run,status\n\xff\xfe,ok\n"),
    "a cut Parquet file": cut("results.parquet"),
    "a cut page": cut("index.html"),
    "no table": lambda out: (out / "results.csv").unlink(),
}
"""Damage of what is made of the rows: no command reads it."""
INSIDE = {
    "a part that was cut": cut("parts/*.jsonl"),
    "a part that is a folder": folder_for("parts/*.jsonl"),
    "no parts": lambda out: shutil.rmtree(out / "parts"),
    "a file for the parts": lambda out: (shutil.rmtree(out / "parts"), (out / "parts").write_bytes(b"")),
    "no listing": lambda out: (out / LISTING).unlink(),
    "a listing that was cut": cut(LISTING),
    "a listing of a path": listing(parts=["../../etc/passwd"]),
    "a part without rows of JSON": part(b"{\n[]\n5\nnull\n\xff\n"),
    "a part of random bytes": part(bytes(range(256)) * 20),
    "another status": row("status", "good"),
    "no job": row("job", None),
    "a job that is a list": row("job", []),
    "a path with a zero byte": row("job.path", "a\0b"),
    "tags that are numbers": row("job.tags", {"group": 5}),
    "an estimate that is NaN": row("estimates.period", [float("nan"), 0.1]),
    "an estimate that is a huge integer": row("estimates.period", [10**400, 0.1]),
    "a negative u": row("estimates.period", [1.0, -0.1]),
    "an outline that is a script": row("thumbnail", '"/><script>alert(1)</script>'),
    "a digest that is a word": row("input_sha256", "right"),
}
"""Damage of the rows themselves: they are not read."""


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two recordings and their course."""
    top = tmp_path_factory.mktemp("course")
    short_course(top / "runs", 2)
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(top)  # rows have the paths of the inputs as they were named
        assert main(list(BATCH)) == OK
    return top


@pytest.fixture
def out(course: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the course; the test stands next to it."""
    shutil.copytree(course, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # where a defect would write its traceback
    return Path("out")


def assert_no_defect(err: str) -> None:
    """No line is part of a traceback, and none says that the program is wrong."""
    assert "Traceback" not in err
    assert "internal error" not in err


def read_by_all(capsys: pytest.CaptureFixture[str]) -> set[int]:
    """Return the exit codes of the commands that read a course."""
    codes = set()
    for command in READERS:
        codes.add(code := main(list(command)))
        err = capsys.readouterr().err
        assert_no_defect(err)
        assert code == OK or err.splitlines()[-1].startswith("springmass: "), command
    return codes


@pytest.mark.parametrize("name", OUTSIDE)
def test_damage_of_a_table_changes_no_answer(out, capsys, name):
    """Commands read the rows and not the tables, and the next pass makes the tables anew."""
    before = (out / "results.csv").read_bytes()
    OUTSIDE[name](out)
    assert read_by_all(capsys) == {OK}
    assert main(list(BATCH)) == OK
    assert "0 analysed" in capsys.readouterr().err
    assert (out / "results.csv").read_bytes() == before


@pytest.mark.parametrize("name", INSIDE)
def test_damage_of_the_rows_is_refused_and_mended(out, capsys, name):
    """Commands that read a damaged course end with one line; the next pass makes it as it was, or names what cannot."""
    before = (out / "results.csv").read_bytes()
    INSIDE[name](out)
    assert read_by_all(capsys) <= {USAGE, UNREADABLE}
    with pytest.raises(ProgramError):
        springmass.results(out)
    code = main(list(BATCH))
    err = capsys.readouterr().err
    assert_no_defect(err)
    if code == USAGE:
        assert "could not be written" in err  # a folder stands in the way
    else:
        assert code == OK
        assert (out / "results.csv").read_bytes() == before


ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_value_at_any_place_is_read_or_refused(course, tmp_path_factory, data):
    """A course is read with a value that its schema allows, and refused in one line with any other one."""
    folder = tmp_path_factory.mktemp("any") / "out"
    shutil.copytree(course / "out", folder)
    sample = rows_of(folder)[0]
    key = data.draw(st.sampled_from(sorted(sample)))
    inner = sample[key]
    keys = [key]
    if isinstance(inner, dict) and inner and data.draw(st.booleans()):
        keys.append(data.draw(st.sampled_from(sorted(inner))))
    put_value(folder, keys, data.draw(ANY_JSON))
    with contextlib.suppress(ProgramError):
        assert len(springmass.results(folder)) == 2
    shutil.rmtree(folder.parent)


@given(data=st.binary(max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_of_a_part_are_read_or_refused(course, tmp_path_factory, data):
    """Bytes under the name of their digest are no rows."""
    folder = tmp_path_factory.mktemp("any") / "out"
    shutil.copytree(course / "out", folder)
    put_part(folder, data)
    if data:
        with pytest.raises(ProgramError):
            springmass.results(folder)
    else:
        assert len(springmass.results(folder)) == 0
    shutil.rmtree(folder.parent)
