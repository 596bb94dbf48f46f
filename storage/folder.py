"""Replace a folder of results as a whole: build it under a temporary name and rename it, so old and new never mix.

If a build is killed, either the old or the new folder is in place, unless the kill came between the two renames. In
that case the next build of the same folder restores the old one. It also removes the leftovers of killed builds.
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
except ImportError:  # Windows: leftovers are kept, because nothing distinguishes them from a running build
    fcntl = None  # type: ignore[assignment]

__all__ = ["whole_folder"]

_LOCKS = bool(fcntl)


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], names: Collection[str], last: str) -> Iterator[Path]:
    """Yield an empty folder to fill, and move it into place when the ``with`` ends without an error.

    Parameters
    ----------
    path : str or PathLike
        The folder to create or replace.
    names : collection of str
        All files that the folder may contain, as relative paths with slashes. If it contains other files, or is the
        working directory, its files are replaced one by one: ``last`` is removed first and written last. Old files
        with one of these names and no replacement are removed.
    last : str
        The file whose presence shows that the folder is complete.

    Yields
    ------
    Path
        An empty folder next to the target.

    Raises
    ------
    WriteFailed
        If the folder cannot be created or moved into place. After an error of the body the old folder is unchanged.
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
    # Truncated, because names have a maximum length; the digest distinguishes names with the same beginning.
    return f".{target.name[:32]}.{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:8]}."


def _clean_up(target: Path) -> None:
    """Restore or remove the folders that killed builds left behind."""
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
