"""Files are written whole or not at all."""

import os
import threading
from pathlib import Path

import pytest

from storage.atomic import whole_file, write_whole
from storage.errors import RunExists, WriteFailed


def beaten_to(path: Path) -> None:
    """Write a new file while another writer makes one of the same name."""
    with whole_file(path, overwrite=False) as temporary:
        temporary.write_text("mine")
        path.write_text("another's")


def test_a_file_that_comes_meanwhile_is_kept(tmp_path: Path) -> None:
    """Putting in place itself refuses a file that was not there when the work began."""
    path = tmp_path / "a"
    with pytest.raises(RunExists):
        beaten_to(path)
    assert path.read_text() == "another's"
    assert list(tmp_path.iterdir()) == [path]


def test_without_hard_links_a_rename_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system without hard links still gets new files, and still keeps standing ones."""

    def no_links(source: object, target: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    path = write_whole(tmp_path / "a", "first", overwrite=False)
    with pytest.raises(RunExists):
        beaten_to(tmp_path / "b")
    assert path.read_text() == "first"
    assert (tmp_path / "b").read_text() == "another's"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_pipe_or_device_is_not_replaced(tmp_path: Path) -> None:
    """Root may rename over /dev/null, and every program then writes to a file on the disk."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(WriteFailed, match="choose the name of a file"):
        write_whole(path, "text")
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("overwrite", [True, False])
def test_the_file_is_synced_before_it_is_placed_and_the_folder_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwrite: bool
) -> None:
    """Content reaches the disk before the name does: fsync of the file, rename, fsync of the folder."""
    path = tmp_path / "a"
    seen: list[tuple[str, bool, bool]] = []
    real_sync = os.fsync
    for name in ("replace", "link"):

        def placing(*args: object, name: str = name, real: object = getattr(os, name)) -> None:
            seen.append(("place", False, path.exists()))
            real(*args)  # type: ignore[operator]

        monkeypatch.setattr(os, name, placing)

    def sync(descriptor: int) -> None:
        is_folder = os.path.samestat(os.fstat(descriptor), tmp_path.stat())
        seen.append(("sync", is_folder, path.exists()))
        real_sync(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    write_whole(path, "x", overwrite=overwrite)
    assert seen == [("sync", False, False), ("place", False, False), ("sync", True, True)]


def test_a_failing_sync_fails_the_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that cannot keep the content leaves the old one in place."""
    path = write_whole(tmp_path / "a", "old")

    def broken(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", broken)
    with pytest.raises(WriteFailed, match="No space left on device"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_is_written_over(tmp_path: Path) -> None:
    """Its temporary file goes with the next file of the name, whatever is in it."""
    with whole_file(tmp_path / "a") as working:
        name = working.name
    (tmp_path / name).write_bytes(b"half of a long file")
    write_whole(tmp_path / "a", "new")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "new"}


@pytest.mark.skipif(os.name == "nt", reason="this system has no such locks")
def test_two_writers_of_a_file_come_one_after_the_other(tmp_path: Path) -> None:
    """The second waits for the first, and neither's content is mixed with the other's."""
    path, waiting = tmp_path / "a", threading.Event()

    def second() -> None:
        waiting.set()
        write_whole(path, "second")

    thread = threading.Thread(target=second)
    with whole_file(path) as temporary:
        temporary.write_text("fir")
        thread.start()
        assert waiting.wait(60)
        thread.join(0.2)
        assert thread.is_alive()
        temporary.write_text("first")
    thread.join(60)
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == {"a": "second"}
