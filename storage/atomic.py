"""A file is written whole or not at all: temporary file, fsync, rename, fsync of the folder.

Existence therefore means completeness: whoever finds the file finds all of it, also after a power cut.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import secrets
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from storage.errors import HDF5_ERRORS, RunExists, WriteFailed, demand_memory, one_line

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    import h5py

__all__ = ["remove_leftovers", "sync_folder", "whole_file", "whole_h5", "write_whole", "writing", "writing_h5"]

# Some network and FUSE file systems cannot sync a folder, and Windows cannot even open one.
_FOLDER_CANNOT_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EACCES, errno.EBADF}


def write_whole(path: str | os.PathLike[str], data: bytes | str, *, overwrite: bool = True) -> Path:
    """Write a file whole.

    Parameters
    ----------
    path : str or PathLike
        The file; its folder must exist.
    data : bytes or str
        Its content; text is encoded as UTF-8, its line ends left as they are.
    overwrite : bool
        Whether a file that stands there may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunExists
        If a file stands there and may not be replaced.
    WriteFailed
        If it cannot be written; what stood there before stands.

    Examples
    --------
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
    """Give a temporary file to write, and put it in place when the ``with`` ends well.

    Parameters
    ----------
    path : str or PathLike
        The file to be made; its folder must exist.
    overwrite : bool
        Whether a file that stands there may be replaced. It is looked for before the work, and the putting in
        place itself refuses one that has come meanwhile.

    Yields
    ------
    Path
        An empty file in the same folder. It must be closed again by the end of the ``with``.

    Raises
    ------
    RunExists
        If a file stands there and may not be replaced.
    WriteFailed
        If the temporary file cannot be made, synced or put in place. After any error, also one of the body,
        the temporary file is gone and what stood there before stands.

    Notes
    -----
    What a killed writer left in the folder goes with the next file that is written there.
    """
    target = Path(path)
    if not overwrite and os.path.lexists(target):
        raise _exists(target)
    remove_leftovers(target.parent)
    temporary, lock = _reserve(target)
    try:
        yield temporary
        with writing(target):
            _sync(temporary)
            _place(temporary, target, overwrite=overwrite)
            sync_folder(target.parent)
    finally:
        # After a rename nothing is left to remove.
        with contextlib.suppress(OSError):
            temporary.unlink()
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def whole_h5(
    path: str | os.PathLike[str], *, overwrite: bool = True, libver: tuple[str, str] | None = None
) -> Iterator[h5py.File]:
    """Give an empty HDF5 file to fill, and put it in place when the ``with`` ends well.

    Parameters
    ----------
    path, overwrite
        As in :func:`whole_file`.
    libver : tuple of str, optional
        Oldest and newest file format, as h5py names them.

    Yields
    ------
    h5py.File
        Open for writing; closed for the caller.

    Raises
    ------
    RunExists, WriteFailed
        As in :func:`whole_file`. Errors of the body pass through: :func:`writing_h5` turns those of HDF5 into
        :class:`WriteFailed`.
    """
    import h5py

    with (
        whole_file(path, overwrite=overwrite) as temporary,
        temporary.open("r+b", buffering=0) as raw,
    ):
        sink = _Sink(raw)
        file = h5py.File(sink, "w", libver=libver)
        try:
            yield file
        except BaseException:
            # Closing writes, and may fail where the body did: the first error is the one to tell.
            with contextlib.suppress(*HDF5_ERRORS):
                file.close()
            if sink.error is None:
                raise
        else:
            with writing_h5(path):
                file.close()
        if sink.error is not None:
            raise _failed(Path(path), sink.error) from sink.error


@contextlib.contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what the system raises where a file or a folder cannot be written into :class:`WriteFailed`."""
    try:
        yield
    except OSError as error:
        raise _failed(Path(path), error) from error


@contextlib.contextmanager
def writing_h5(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what HDF5 raises on a full disk or a value that it cannot hold into one line."""
    try:
        yield
    except HDF5_ERRORS as error:
        demand_memory(path, error)
        remedy = "check the disk's space and what was handed over"
        raise WriteFailed(path, f"could not be written ({one_line(error)})", remedy) from error


class _Sink:
    """A file for HDF5 that never refuses a write: it keeps the disk's first refusal and drops the rest.

    The HDF5 library takes the process down when the disk is full: closing fails, and what could not be closed
    is closed again at exit. So it is told that all went well, and the caller is told the truth after closing.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self.error: OSError | None = None

    def write(self, data: memoryview) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        with self._keeping():
            while len(rest) and self.error is None:  # a nearly full disk takes a part
                rest = rest[self._raw.write(rest) :]
        return size

    def read(self, size: int = -1) -> bytes:
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        room = memoryview(buffer).cast("B")
        got = self._raw.readinto(room)
        room[got:] = bytes(len(room) - got)  # what a full disk did not take
        return len(room)

    def truncate(self, size: int) -> int:
        with self._keeping():
            self._raw.truncate(size)
        return size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Nothing is buffered here."""

    @contextlib.contextmanager
    def _keeping(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.error = self.error or error


_LEFTOVER = re.compile(r"\..{1,32}\.[0-9a-f]{8}\.part", re.DOTALL)


def remove_leftovers(folder: Path) -> tuple[Path, ...]:
    """Remove what writers left that were killed, and return it; what a living one is at work on stays.

    A writer holds a lock on its temporary file, which ends with it, however it ends. Where a system or a file system
    has no locks, nothing is removed.
    """
    if sys.platform == "win32":
        return ()
    removed = []
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(folder)):
            if _LEFTOVER.fullmatch(name) and _abandoned(folder / name):
                removed.append(folder / name)
    return tuple(removed)


def _abandoned(leftover: Path) -> bool:
    """Remove a temporary file that nobody holds; return whether it is gone."""
    with contextlib.suppress(OSError), leftover.open("r+b") as file:
        assert sys.platform != "win32"
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        leftover.unlink()
        return True
    return False


def _reserve(target: Path) -> tuple[Path, int | None]:
    """Make an empty hidden file beside the target, with the permissions that any new file would get, and lock it."""
    while True:
        # The name is cut, so that a target of the longest allowed name still gets a temporary one.
        temporary = target.with_name(f".{target.name[:32]}.{secrets.token_hex(4)}.part")
        with writing(target):
            descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        if sys.platform == "win32":
            os.close(descriptor)
            return temporary, None
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if os.fstat(descriptor).st_nlink:
            return temporary, descriptor
        os.close(descriptor)  # taken for a leftover before it was locked


def _sync(file: Path) -> None:
    # Windows syncs only what was opened for writing.
    descriptor = os.open(file, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _place(temporary: Path, target: Path, *, overwrite: bool) -> None:
    if overwrite:
        os.replace(temporary, target)
        return
    # A hard link fails where a name exists, which a rename does not: no gap between looking and placing.
    try:
        os.link(temporary, target)
    except FileExistsError as error:
        raise _exists(target) from error
    except OSError:  # a file system without hard links, such as a memory stick's
        if os.path.lexists(target):
            raise _exists(target) from None
        os.replace(temporary, target)


def sync_folder(folder: Path) -> None:
    """Return when the names in a folder are safe on the disk, where its file system can do that. Raises OSError."""
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


def _exists(target: Path) -> RunExists:
    demand = "a new file was to be written, but one stands there"
    return RunExists(target, demand, "choose another name or allow overwriting")


def _failed(target: Path, error: OSError) -> WriteFailed:
    reason = error.strerror or one_line(error)
    missing = isinstance(error, FileNotFoundError)
    remedy = "make the folder first" if missing else "check the disk's space and permissions"
    return WriteFailed(target, f"could not be written ({reason})", remedy)
