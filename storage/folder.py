"""Replace a folder of results as a whole: build it under a temporary name and rename it, so old and new never mix.

After a kill either the old folder or the new one is in place. The next build of the same folder removes what the killed
one left, and restores the old folder if the kill came between the two renames.
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
except ImportError:  # Windows: leftovers stay, because nothing distinguishes them from a build that is running
    fcntl = None  # type: ignore[assignment]

__all__ = ["whole_folder"]

_LOCKS = bool(fcntl)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], names: Collection[str], last: str) -> Iterator[Path]:
    """Give an empty folder to fill, and put it in place when the ``with`` ends without an error.

    Parameters
    ----------
    path : str or PathLike
        The folder to be made or replaced.
    names : collection of str
        All files that may be made in it, as relative paths with slashes. If the folder holds other files, or is the
        working directory, its files are replaced one by one: ``last`` is removed first and written last. Files of
        these names that were not made this time are removed.
    last : str
        The file whose presence shows that the folder is complete.

    Yields
    ------
    Path
        An empty folder next to the target.

    Raises
    ------
    WriteFailed
        If it cannot be made or put in place. After an error of the body the old folder is unchanged.
    """
    target = Path(path).resolve()
    with _writing_folder(path):
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file of that name exists")
        target.parent.mkdir(parents=True, exist_ok=True)
        _clean_up(target)
        part = _beside(target, "part")
        part.mkdir()
        lock = os.open(part, os.O_RDONLY) if _LOCKS else None
    try:
        if lock is not None:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield part
        with _writing_folder(path):
            _replace(part, target, names, last)
            sync_folder(target.parent)
    finally:
        if lock is not None:
            os.close(lock)
        shutil.rmtree(part, ignore_errors=True)


def _replace(part: Path, target: Path, names: Collection[str], last: str) -> None:
    existing = _files(target)
    cwd = Path.cwd()
    if not target.exists():
        os.rename(part, target)
    elif existing <= set(names) and target != cwd and target not in cwd.parents and not os.path.ismount(target):
        old = _beside(target, "old")
        os.rename(target, old)
        os.rename(part, target)
        shutil.rmtree(old)
    else:
        new = _files(part)
        for name in (last, *sorted(existing & set(names) - new)):
            (target / name).unlink(missing_ok=True)
        for name in (*sorted(new - {last}), last):
            (target / name).parent.mkdir(exist_ok=True)
            os.replace(part / name, target / name)


def _files(folder: Path) -> set[str]:
    return {each.relative_to(folder).as_posix() for each in folder.rglob("*") if each.is_symlink() or not each.is_dir()}


def _beside(target: Path, kind: str) -> Path:
    return target.with_name(f"{_prefix(target)}{secrets.token_hex(4)}.{kind}")


def _prefix(target: Path) -> str:
    # Truncated, because names have a maximal length; the digest distinguishes names with the same beginning.
    return f".{target.name[:32]}.{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:8]}."


def _clean_up(target: Path) -> None:
    """Restore or remove what a killed build left."""
    if not _LOCKS:
        return
    for leftover in [each for each in target.parent.iterdir() if each.name.startswith(_prefix(target))]:
        if leftover.suffix == ".old" and not target.exists():
            os.rename(leftover, target)
        elif _abandoned(leftover):
            shutil.rmtree(leftover)


def _abandoned(folder: Path) -> bool:
    """Return whether no process has locked a folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


@contextlib.contextmanager
def _writing_folder(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        problem = f"the folder for results cannot be made ({error.strerror or one_line(error)})"
        remedy = "check the disk space and the permissions, or choose another folder"
        raise WriteFailed(path, problem, remedy) from error
