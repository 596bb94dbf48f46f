"""A folder of results: the old one or the new one stands there, never anything between."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from storage.errors import WriteFailed
from storage.folder import whole_folder

NAMES = {"page", "table", "old", "figures/a"}


def fill(folder: Path, content: str) -> None:
    """Make one result of two files."""
    (folder / "table").write_text(content)
    (folder / "page").write_text(content)


def held(folder: Path) -> dict[str, str]:
    """Return what a folder holds, hidden things beside it among them."""
    every = [*folder.rglob("*"), *folder.parent.glob(".*")]
    return {os.path.relpath(each, folder): each.read_text() for each in every if each.is_file()}


def make(folder: Path, content: str) -> None:
    """Write a result whole."""
    with whole_folder(folder, NAMES, "page") as part:
        fill(part, content)


def test_a_folder_is_replaced_whole(tmp_path: Path) -> None:
    """What the earlier one held and this one does not is gone; nothing is left beside."""
    folder = tmp_path / "a" / "run.results"
    with whole_folder(folder, NAMES, "page") as part:
        fill(part, "1")
        (part / "old").write_text("1")
        (part / "figures").mkdir()
        (part / "figures/a").write_text("1")
    make(folder, "2")
    assert held(folder) == {"page": "2", "table": "2"}


def test_a_build_that_fails_leaves_the_old_one(tmp_path: Path) -> None:
    """After an error of the body what stood there stands."""
    folder = tmp_path / "run.results"
    make(folder, "1")
    with pytest.raises(TypeError), whole_folder(folder, NAMES, "page") as part:
        (part / "table").write_text(2)  # type: ignore[arg-type]
    assert held(folder) == {"page": "1", "table": "1"}


@pytest.mark.parametrize("inside", [False, True])
def test_what_others_put_there_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, inside: bool) -> None:
    """A folder with other files, or that somebody stands in, keeps its place and its files; stale ones of ours go."""
    folder = tmp_path / "mine"
    make(folder, "1")
    (folder / "old").write_text("1")
    if inside:
        monkeypatch.chdir(folder)
        folder = Path()
    else:
        (folder / "notes.txt").write_text("mine")
    before = os.stat(folder).st_ino
    make(folder, "2")
    assert os.stat(folder).st_ino == before
    assert held(folder.resolve()) == {"page": "2", "table": "2"} | ({} if inside else {"notes.txt": "mine"})


def test_the_longest_name_is_a_name(tmp_path: Path) -> None:
    """What is built beside it has a shorter one."""
    folder = tmp_path / ("b" * 255)
    make(folder, "1")
    make(folder, "2")
    assert held(folder) == {"page": "2", "table": "2"}


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    """A file stands where a folder above should be."""
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteFailed, match="folder for results"):
        make(tmp_path / "file" / "run.results", "1")


CHILD = """
import os, sys, threading
from pathlib import Path
from storage.folder import whole_folder
calls = 0
def count(*_):
    global calls
    calls += 1
    if calls == int(sys.argv[2]):
        os.write(1, b"here\\n")
        threading.Event().wait()
sys.setprofile(count)
with whole_folder(sys.argv[1], {"page", "table", "old", "figures/a"}, "page") as part:
    (part / "table").write_text("2")
    (part / "page").write_text("2")
sys.setprofile(None)
print(calls)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX")
def test_kill_9_leaves_the_old_or_the_new(tmp_path: Path) -> None:
    """At any moment of the build; the next build takes away what was left, and finds the old one where none stood."""
    command = [sys.executable, "-c", CHILD, str(tmp_path / "run.results")]
    root = Path(__file__).parents[3]
    make(tmp_path / "run.results", "1")
    done = subprocess.run([*command, "0"], capture_output=True, text=True, check=True, cwd=root)
    limit = int(done.stdout)
    for number in range(12):
        folder = tmp_path / f"{number}" / "run.results"
        make(folder, "1")
        command[3] = str(folder)
        child = subprocess.Popen([*command, str(1 + number * (limit - 2) // 11)], stdout=subprocess.PIPE, cwd=root)
        assert child.stdout is not None
        assert child.stdout.readline() == b"here\n"
        child.kill()
        child.wait()
        child.stdout.close()
        result = (
            {name: text for name, text in held(folder).items() if not name.startswith("..")} if folder.is_dir() else {}
        )
        assert result in ({"page": "1", "table": "1"}, {"page": "2", "table": "2"}, {})
        if not result:  # between the two renames
            assert any(each.suffix == ".old" for each in folder.parent.iterdir())
        with pytest.raises(KeyError), whole_folder(folder, NAMES, "page"):
            raise KeyError  # a build that fails still tidies
        survivors = held(folder)
        assert survivors in ({"page": "1", "table": "1"}, {"page": "2", "table": "2"})
        make(folder, "3")
        assert held(folder) == {"page": "3", "table": "3"}
        assert [each.name for each in folder.parent.iterdir()] == ["run.results"]
