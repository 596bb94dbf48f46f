"""Write files whole or not at all: temporary file, fsync, rename, fsync of the folder.

A file that exists is therefore complete, even after a power cut.
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

from storage.errors import HDF5_ERRORS, RunExists, WriteFailed, one_line, raise_if_out_of_memory

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
        Its content; text is encoded as UTF-8, with its line ends unchanged.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RunExists
        If the file exists and may not be replaced.
    WriteFailed
        If it cannot be written; an existing file is then unchanged.

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
    """Yield a temporary file for writing, and move it into place when the ``with`` ends without an error.

    Parameters
    ----------
    path : str or PathLike
        The file to create; its folder must exist.
    overwrite : bool
        Whether an existing file may be replaced. This is checked before the body runs and again when the new file is
        moved into place.

    Yields
    ------
    Path
        An empty file in the same folder. It must be closed again by the end of the ``with``.

    Raises
    ------
    RunExists
        If the file exists and may not be replaced.
    WriteFailed
        If the temporary file cannot be created, synced or moved into place. After any error, including one of the
        body, the temporary file is removed and an existing file is unchanged.

    Notes
    -----
    The temporary file of a killed writer is removed when the next file is written to the same folder.
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
        # After a rename there is nothing to remove.
        with contextlib.suppress(OSError):
            temporary.unlink()
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def whole_h5(
    path: str | os.PathLike[str], *, overwrite: bool = True, libver: tuple[str, str] | None = None
) -> Iterator[h5py.File]:
    """Yield an empty HDF5 file to fill, and move it into place when the ``with`` ends without an error.

    Parameters
    ----------
    path, overwrite
        As in :func:`whole_file`.
    libver : tuple of str, optional
        Oldest and newest file format, by their names in h5py.

    Yields
    ------
    h5py.File
        Open for writing; closed for the caller.

    Raises
    ------
    RunExists, WriteFailed
        As in :func:`whole_file`. Errors of the body pass through; :func:`writing_h5` converts errors of HDF5 to
        :class:`WriteFailed`.
    """
    import h5py

    with (
        whole_file(path, overwrite=overwrite) as temporary,
        temporary.open("r+b", buffering=0) as raw,
    ):
        sink = _ErrorKeepingFile(raw)
        file = h5py.File(sink, "w", libver=libver)
        try:
            yield file
        except BaseException:
            # Closing also writes and may fail for the same reason, so report the first error.
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
    """Convert an OSError during the writing of a file or folder to :class:`WriteFailed`."""
    try:
        yield
    except OSError as error:
        raise _failed(Path(path), error) from error


@contextlib.contextmanager
def writing_h5(path: str | os.PathLike[str]) -> Iterator[None]:
    """Convert the errors that HDF5 raises on a full disk or an unstorable value to :class:`WriteFailed`."""
    try:
        yield
    except HDF5_ERRORS as error:
        raise_if_out_of_memory(path, error)
        remedy = "check the disk space and the values to be written"
        raise WriteFailed(path, f"could not be written ({one_line(error)})", remedy) from error


class _ErrorKeepingFile:
    """A file for HDF5 whose writes never fail: it keeps the first error of the disk and ignores later writes.

    The HDF5 library crashes the process when the disk is full: closing fails, and the library closes the file once
    more at exit. This class therefore hides the error from HDF5, and the caller raises it after closing.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self.error: OSError | None = None

    def write(self, data: memoryview) -> int:
        pending = memoryview(data).cast("B")
        size = len(pending)
        with self._recording_error():
            while len(pending) and self.error is None:  # a nearly full disk writes only a part of the data
                pending = pending[self._raw.write(pending) :]
        return size

    def read(self, size: int = -1) -> bytes:
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        room = memoryview(buffer).cast("B")
        got = self._raw.readinto(room)
        room[got:] = bytes(len(room) - got)  # zeros for the bytes that a full disk did not write
        return len(room)

    def truncate(self, size: int) -> int:
        with self._recording_error():
            self._raw.truncate(size)
        return size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Nothing is buffered here."""

    @contextlib.contextmanager
    def _recording_error(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.error = self.error or error


_LEFTOVER = re.compile(r"\..{1,32}\.[0-9a-f]{8}\.part", re.DOTALL)


def remove_leftovers(folder: Path) -> tuple[Path, ...]:
    """Remove the temporary files of killed writers, but not those of running writers; return the removed paths.

    A writer locks its temporary file, and the system releases the lock when the writer ends. Without file locks
    (Windows, some network disks) nothing is removed.
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
    """Remove a temporary file that no process has locked; return whether it was removed."""
    with contextlib.suppress(OSError), leftover.open("r+b") as file:
        assert sys.platform != "win32"
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        leftover.unlink()
        return True
    return False


def _reserve(target: Path) -> tuple[Path, int | None]:
    """Create and lock an empty hidden file next to the target, with the default permissions of a new file."""
    while True:
        # Truncate the name, so that the temporary name of a target with a long name is not too long.
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
        os.close(descriptor)  # another process removed it as a leftover before it was locked


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
    except FileExistsError as error:
        raise _exists(target) from error
    except OSError:  # a file system without hard links, such as FAT
        if os.path.lexists(target):
            raise _exists(target) from None
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


def _exists(target: Path) -> RunExists:
    return RunExists(target, "already exists", "choose another name or allow overwriting")


def _failed(target: Path, error: OSError) -> WriteFailed:
    reason = error.strerror or one_line(error)
    missing = isinstance(error, FileNotFoundError)
    remedy = "make the folder first" if missing else "check the disk space and the permissions"
    return WriteFailed(target, f"could not be written ({reason})", remedy)
