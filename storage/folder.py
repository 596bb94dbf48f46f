"""Replace the files of a results folder: build them under a temporary name, then move them one by one.

One file is removed first and moved last. A folder that contains it is therefore complete, and all its files are of the
same build. A killed build leaves a hidden folder without a lock, which the next build of the same folder uses again.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

from storage.atomic import lock_new, part_of, sync_folder
from storage.errors import WriteFailed, one_line


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], names: Collection[str], last: str) -> Iterator[Path]:
    """Yield an empty folder to fill, and move its files into place when the ``with`` ends without an error.

    ``names`` are all files that a build may make, as relative paths with slashes; those of an earlier build that this
    one did not make are removed. ``last`` is the file that shows that the folder is complete. Raises WriteFailed if the
    folder cannot be made; after an error of the body the old files are unchanged.
    """
    target = Path(path).resolve()
    part, lock = part_of(target), None
    with _writing_folder(path):
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file of that name exists")
        target.parent.mkdir(parents=True, exist_ok=True)
        if os.name == "nt":
            part.mkdir(exist_ok=True)
        else:
            lock = lock_new(part, _open_folder)
    try:
        with _writing_folder(path):
            for leftover in part.iterdir():
                shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
        yield part
        with _writing_folder(path):
            _move(part, target, names, last)
            sync_folder(target)
            sync_folder(target.parent)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _move(part: Path, target: Path, names: Collection[str], last: str) -> None:
    new = sorted(each.relative_to(part).as_posix() for each in part.rglob("*") if not each.is_dir())
    for name in (last, *sorted(set(names) - {*new})):
        (target / name).unlink(missing_ok=True)
    for name in sorted(new, key=lambda name: name == last):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(part / name, target / name)


def _open_folder(path: Path) -> int:
    path.mkdir(exist_ok=True)
    return os.open(path, os.O_RDONLY)


@contextlib.contextmanager
def _writing_folder(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        problem = f"the folder for results cannot be made ({error.strerror or one_line(error)})"
        remedy = "check the disk space and the permissions, or choose another folder"
        raise WriteFailed(path, problem, remedy) from error
