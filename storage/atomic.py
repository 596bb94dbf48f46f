"""Write files whole or not at all: temporary file, fsync, rename, fsync of the folder. Replace the files of a folder.

A file that exists is therefore complete, even after a power cut. The temporary file of NAME is always .NAME.part, and
its writer holds a lock on it. A second writer of the same file waits for the lock; the file that a killed writer left
behind has no lock and is used again.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from storage.errors import RunExists, WriteFailed, one_line
from storage.locks import lock

# Some network and FUSE file systems cannot sync a folder, and Windows cannot even open one.
_FOLDER_CANNOT_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EBADF}
_LONGEST_NAME = 240  # bytes; with a dot and ".part", it fits into the 255 of every file system


def write_whole(path: str | os.PathLike[str], data: bytes | str, *, overwrite: bool = True) -> Path:
    """Write a file whole, text as UTF-8 with its line ends unchanged; return its path.

    Raises RunExists if the file exists and may not be replaced, and WriteFailed if it cannot be written. An existing
    file is then unchanged.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_whole(folder + "/results.json", "{}").read_text()
    '{}'
    """
    content = data.encode() if isinstance(data, str) else data
    with whole_file(path, overwrite=overwrite) as temporary, writing(path):
        temporary.write_bytes(content)
    return Path(path)


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], *, overwrite: bool = True) -> Iterator[Path]:
    """Yield an empty temporary file for writing, and move it into place when the ``with`` ends without an error.

    After any error, including one of the body, the temporary file is removed and an existing file is unchanged. Raises
    RunExists and WriteFailed like :func:`write_whole`; whether the file exists is also checked before the body runs.
    """
    target = Path(path)
    if not overwrite and os.path.lexists(target):
        raise already_exists(target)
    if target.exists() and not (target.is_file() or target.is_dir()):  # a rename would replace even /dev/null
        raise WriteFailed(target, "is a device or a pipe, and no file", "choose the name of a file")
    temporary = part_of(target)
    with writing(target):
        descriptor = lock_new(temporary, _open_file)
    try:
        with writing(target):
            os.truncate(temporary, 0)
        yield temporary
        with writing(target):
            _sync(temporary)
            _place(temporary, target, overwrite=overwrite)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    finally:
        if descriptor is not None:
            os.close(descriptor)
    with writing(target):
        sync_folder(target.parent)


def part_of(target: Path) -> Path:
    """Return the path of a file's or folder's temporary name."""
    name = os.fsencode(target.name)
    short = target.name if len(name) <= _LONGEST_NAME else hashlib.sha256(name).hexdigest()
    return target.with_name(f".{short}.part")


def lock_new(path: Path, opened: Callable[[Path], int]) -> int | None:
    """Create and lock a temporary file or folder; return its descriptor, or None where there are no locks."""
    while True:
        descriptor, keeps = opened(path), False
        try:
            if not lock(descriptor, wait=True):
                return None
            with contextlib.suppress(FileNotFoundError):  # the writer that held the lock has moved or removed the file
                keeps = os.path.samestat(os.fstat(descriptor), os.lstat(path))
            if keeps:
                return descriptor
        finally:
            if not keeps:  # also after a Ctrl-C: the next writer of this process must not wait for this lock
                os.close(descriptor)


def _open_file(path: Path) -> int:
    return os.open(path, os.O_CREAT | os.O_RDWR | getattr(os, "O_NOFOLLOW", 0), 0o666)


@contextlib.contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert an OSError during the writing of a file or folder to :class:`WriteFailed`."""
    try:
        yield
    except OSError as error:
        raise write_failed(Path(path), error) from error


def write_failed(target: Path, error: OSError) -> WriteFailed:
    """Return the error for a file that could not be written because of an OSError."""
    reason = error.strerror or one_line(error)
    missing = isinstance(error, FileNotFoundError)
    remedy = "make the folder first" if missing else "check the disk space and the permissions"
    return WriteFailed(target, f"could not be written ({reason})", remedy)


def _sync(file: Path) -> None:
    # Windows syncs only files that were opened for writing.
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _place(temporary: Path, target: Path, *, overwrite: bool) -> None:
    if overwrite:
        os.replace(temporary, target)
        return
    # Unlike a rename, a hard link fails if the name exists, so no other file can appear between check and placement.
    try:
        os.link(temporary, target)
        temporary.unlink()
    except FileExistsError as error:
        raise already_exists(target) from error
    except OSError:  # a file system without hard links, such as FAT
        if os.path.lexists(target):
            raise already_exists(target) from None
        os.replace(temporary, target)


def sync_folder(folder: Path) -> None:
    """Sync the file names of a folder to the disk if its file system supports this. Raises OSError."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        if error.errno in _FOLDER_CANNOT_SYNC:
            return
        raise
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _FOLDER_CANNOT_SYNC:
            raise
    finally:
        os.close(descriptor)


def already_exists(target: Path) -> RunExists:
    """Return the error for a file that may not be replaced."""
    return RunExists(target, "already exists", "choose another name or allow overwriting")


@contextlib.contextmanager
def whole_folder(path: str | os.PathLike[str], names: Collection[str], last: str) -> Iterator[Path]:
    """Yield an empty folder to fill, and move its files into place when the ``with`` ends without an error.

    ``names`` are all files that a build may make, as relative paths with slashes; those of an earlier build that this
    one did not make are removed. ``last`` is the file that shows that the folder is complete. Raises WriteFailed if the
    folder cannot be made; after an error of the body the old files are unchanged.
    """
    target = Path(path).resolve()
    part, held = part_of(target), None
    with writing(path):
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file of that name exists")
        target.parent.mkdir(parents=True, exist_ok=True)
        if os.name == "nt":
            part.mkdir(exist_ok=True)
        else:
            held = lock_new(part, _open_folder)
    try:
        with writing(path):
            for leftover in part.iterdir():
                shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
        yield part
        with writing(path):
            _move(part, target, names, last)
            sync_folder(target)
            sync_folder(target.parent)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        if held is not None:
            os.close(held)


def remove_files(path: str | os.PathLike[str], names: Collection[str], last: str) -> None:
    """Remove the files of a build, ``last`` first, and then the folders that are empty; other files stay."""
    target = Path(path).resolve()
    with writing(path):
        _unlink(target, names, last)
        for folder in sorted({target, *((target / name).parent for name in names)}, reverse=True):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def _unlink(target: Path, names: Collection[str], last: str) -> None:
    for name in (last, *sorted(names)):
        (target / name).unlink(missing_ok=True)


def _move(part: Path, target: Path, names: Collection[str], last: str) -> None:
    new = sorted(each.relative_to(part).as_posix() for each in part.rglob("*") if not each.is_dir())
    _unlink(target, set(names) - {*new}, last)
    for name in sorted(new, key=lambda name: name == last):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        os.replace(part / name, target / name)


def _open_folder(path: Path) -> int:
    path.mkdir(exist_ok=True)
    return os.open(path, os.O_RDONLY)
