"""Write and read run files by HDF5, whole or not at all, with errors of one line."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from storage.atomic import whole_file, write_failed
from storage.errors import OutOfMemory, RunDamaged, RunOpen, StorageError, WriteFailed, one_line

if TYPE_CHECKING:
    import h5py

_ERRORS = (OSError, KeyError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""Errors that h5py raises on a wrong checksum, a missing object, a full disk or a value that HDF5 cannot store."""
_NO_MEMORY = re.compile("memory alloc|alloc[a-z]* memory|out of memory|cannot allocate", re.IGNORECASE)
_OPEN = {
    "unable to lock file": "on a disk without locks: set HDF5_USE_FILE_LOCKING=FALSE",
    "file is already open for write": "if it has crashed: h5clear -s FILE",
}
"""Errors of HDF5 if another program has a file open for writing, and what else can cause each of them."""
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_LIBVER = ("v110", "v110")
"""The file format of HDF5 1.10 (2016), the oldest with checksums in all of the file's metadata."""


@contextlib.contextmanager
def whole_h5(path: Path, *, overwrite: bool) -> Iterator[h5py.File]:
    """Yield an empty HDF5 file to fill, and move it into place as :func:`storage.atomic.whole_file` does.

    Errors of the body pass through, unless the disk has failed before; :func:`writing_h5` converts those of HDF5.
    """
    with whole_file(path, overwrite=overwrite) as temporary, temporary.open("r+b", buffering=0) as raw:
        sink, file = _ErrorKeepingFile(raw), None
        try:
            with _signals_wait():
                import h5py

                file = h5py.File(sink, "w", libver=_LIBVER)
            yield file
        except BaseException:
            # Closing also writes and may fail for the same reason, so report the first error.
            with _signals_wait(), contextlib.suppress(*_ERRORS):
                if file is not None:
                    file.close()
            if sink.error is None:
                raise
        else:
            with writing_h5(path):
                file.close()
        if sink.error is not None:
            raise write_failed(path, sink.error) from sink.error


@contextlib.contextmanager
def writing_h5(path: Path) -> Iterator[None]:
    """Convert the errors that HDF5 raises on a full disk or an unstorable value to :class:`WriteFailed`."""
    try:
        with _signals_wait():
            yield
    except StorageError:
        raise
    except _ERRORS as error:
        _raise_if_out_of_memory(path, error)
        remedy = "check the disk space and the values to be written"
        raise WriteFailed(path, f"could not be written ({one_line(error)})", remedy) from error


@contextlib.contextmanager
def _signals_wait() -> Iterator[None]:
    """Call the handlers of signals only at the end: HDF5 breaks if one of them raises in :class:`_ErrorKeepingFile`."""
    before, arrived = dict[int, Any](), list[int]()
    try:
        with contextlib.suppress(ValueError):  # another thread than the main thread, in which no handler runs
            for number in [each for each in _SIGNALS if callable(signal.getsignal(each))]:
                before[number] = signal.signal(number, lambda number, _: arrived.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in arrived:
            before[number](number, None)


@contextlib.contextmanager
def reading_h5(path: Path, what: str) -> Iterator[None]:
    """Convert the errors that HDF5 raises on damaged bytes to :class:`RunDamaged`; ``what`` is read."""
    try:
        yield
    except StorageError:
        raise
    except _ERRORS as error:
        _raise_if_out_of_memory(path, error)
        for sign, otherwise in _OPEN.items():
            if sign in str(error):
                raise RunOpen(path, "is open in another program", f"close it there ({otherwise})") from error
        raise damaged(path, what, one_line(error)) from error


def damaged(path: Path, what: str, how: str) -> RunDamaged:
    """Return the error for a damaged part of a run file."""
    remedy = "restore a copy of the file, or make it again from the wire log or recording"
    return RunDamaged(path, f"{what} is damaged: {how}", remedy)


def _raise_if_out_of_memory(path: Path, error: BaseException) -> None:
    if isinstance(error, MemoryError) or _NO_MEMORY.search(str(error)):
        raise OutOfMemory(path, "out of memory", "close other programs or raise the memory limit") from error


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
        try:
            while len(pending) and self.error is None:  # a nearly full disk writes only a part of the data
                pending = pending[self._raw.write(pending) :]
        except OSError as error:
            self.error = error
        return size

    def read(self, size: int = -1) -> bytes:
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        room = memoryview(buffer).cast("B")
        got = self._raw.readinto(room)
        room[got:] = bytes(len(room) - got)  # zeros for the bytes that a full disk did not write
        return len(room)

    def truncate(self, size: int) -> int:
        try:
            self._raw.truncate(size)
        except OSError as error:
            self.error = self.error or error
        return size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Nothing is buffered here."""
