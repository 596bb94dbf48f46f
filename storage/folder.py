"""A folder of results is built beside its place and put there by rename: nobody finds the old and the new mixed.

A kill leaves the old folder or the new one. What a killed build left beside is taken away by the next build of the same
folder, which also puts the old one back where the kill fell between the two renames.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

from storage.atomic import sync_folder
from storage.errors import WriteFailed, one_line

try:
    import fcntl
except ImportError:  # Windows: leftovers stay, for nothing tells them from what is being built
    fcntl = None  # type: ignore[assignment]

__all__ = ["whole_folder"]

_LOCKS = bool(fcntl)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], names: Collection[str], last: str) -> Iterator[Path]:
    """Give an empty folder to fill, and put it in place when the ``with`` ends well.

    Parameters
    ----------
    path : str or PathLike
        The folder to be made or replaced.
    names : collection of str
        Whatever may be made in it, as relative paths with slashes. A folder that holds anything else, or that a
        process stands in, is not replaced: its files are, one by one, ``last`` taken away first and put there last.
        Files of these names that were not made this time are taken away.
    last : str
        The file whose presence says that the rest is there.

    Yields
    ------
    Path
        An empty folder beside the place.

    Raises
    ------
    WriteFailed
        If it cannot be made or put in place. After an error of the body what stood there before stands.
    """
    target = Path(path).resolve()
    with _told(path):
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file of that name stands there")
        target.parent.mkdir(parents=True, exist_ok=True)
        _tidy(target)
        part = _beside(target, "part")
        part.mkdir()
        lock = os.open(part, os.O_RDONLY) if _LOCKS else None
    try:
        if lock is not None:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield part
        with _told(path):
            _replace(part, target, names, last)
            sync_folder(target.parent)
    finally:
        if lock is not None:
            os.close(lock)
        shutil.rmtree(part, ignore_errors=True)


def _replace(part: Path, target: Path, names: Collection[str], last: str) -> None:
    held = _files(target)
    cwd = Path.cwd()
    if not target.exists():
        os.rename(part, target)
    elif held <= set(names) and target != cwd and target not in cwd.parents and not os.path.ismount(target):
        old = _beside(target, "old")
        os.rename(target, old)
        os.rename(part, target)
        shutil.rmtree(old)
    else:
        made = _files(part)
        for name in (last, *sorted(held & set(names) - made)):
            (target / name).unlink(missing_ok=True)
        for name in (*sorted(made - {last}), last):
            (target / name).parent.mkdir(exist_ok=True)
            os.replace(part / name, target / name)


def _files(folder: Path) -> set[str]:
    return {each.relative_to(folder).as_posix() for each in folder.rglob("*") if each.is_symlink() or not each.is_dir()}


def _beside(target: Path, kind: str) -> Path:
    return target.with_name(f"{_prefix(target)}{secrets.token_hex(4)}.{kind}")


def _prefix(target: Path) -> str:
    # Cut, so that the longest allowed name still gets one; the digest tells names apart that begin alike.
    return f".{target.name[:32]}.{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:8]}."


def _tidy(target: Path) -> None:
    """Put back or take away what a killed build left."""
    if not _LOCKS:
        return
    for left in [each for each in target.parent.iterdir() if each.name.startswith(_prefix(target))]:
        if left.suffix == ".old" and not target.exists():
            os.rename(left, target)
        elif _abandoned(left):
            shutil.rmtree(left)


def _abandoned(folder: Path) -> bool:
    """Tell whether no process holds a folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


@contextlib.contextmanager
def _told(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        demand = f"a folder for results was demanded, it cannot be made ({error.strerror or one_line(error)})"
        raise WriteFailed(path, demand, "check the disk's space and permissions, or name another with --out") from error
