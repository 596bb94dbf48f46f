"""Where a log lies while it is recorded: under its name, or where somebody moved it to meanwhile.

What is appended reaches the file whatever becomes of its name. So a log that was renamed, with its folder or without,
is found again, and one that was deleted is written anew from the file that is still open.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from storage.errors import WriteFailed, one_line

__all__ = ["LogPlace", "LogPlaces"]

OPEN_FILES = Path("/proc/self/fd")
"""Where Linux tells the present name of an open file."""


class LogPlaces:
    """Holds on to all files of a log, from the first that has just been made.

    Parameters
    ----------
    path : Path
        The first file.
    """

    def __init__(self, path: Path) -> None:
        self._places = [LogPlace(path)]

    @property
    def astray(self) -> str:
        """What became of the first name that leads elsewhere, for people; empty while all lead to the log."""
        return next((place.astray for place in self._places if place.astray), "")

    def look(self, files: Sequence[Path]) -> None:
        """See whether the names still lead to the log, whose files these are by now, in order."""
        self._places += [LogPlace(path, path.name) for path in files[len(self._places) :]]
        for place in self._places:
            place.look()

    def found(self) -> Path:
        """Return where the log is, its further files beside the first; written anew where that takes it.

        Raises
        ------
        WriteFailed
            If a file has no name and cannot be written anew.
        """
        first, *others = self._places
        there = first.found()
        for place in others:
            number = int(place.path.stem.rpartition(".")[2])
            place.bring(further_names(there, number))
        return there

    def close(self) -> None:
        """Let go of them."""
        for place in self._places:
            place.close()


def further_names(path: Path, number: int) -> Iterator[Path]:
    """Yield the names under which a log's further file is found beside its first, the usual one first.

    Examples
    --------
    >>> [name.name for name in further_names(Path("run.wire"), 1)][:2]
    ['run.001.wire', 'run.0001.wire']
    """
    return (path.with_name(f"{path.stem}.{number:0{digits}d}{path.suffix}") for digits in range(3, 10))


class LogPlace:
    """Holds on to one file of a log.

    Parameters
    ----------
    path : Path
    what : str
        What messages call it.

    Attributes
    ----------
    astray : str
        What became of the log's name, for people; empty while it leads to the log.
    """

    def __init__(self, path: Path, what: str = "the log") -> None:
        self.path = path
        self.astray = ""
        self._what = what
        self._descriptor = -1
        with contextlib.suppress(OSError):  # then nothing is known of it; the log is recorded all the same
            self._descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))

    def look(self) -> None:
        """See whether the name still leads to the log."""
        if self._descriptor < 0 or os.name == "nt":  # Windows lets nobody rename or remove an open file
            return
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self.path)
        except OSError:
            gone = "was deleted" if own.st_nlink == 0 else "or its folder was renamed"
            self.astray = f"{self._what} {gone}"
            return
        same = (there.st_dev, there.st_ino) == (own.st_dev, own.st_ino)
        self.astray = "" if same else f"another file has taken the name of {self._what}"

    def found(self) -> Path:
        """Return where the log is, written anew where it has no name any more.

        Raises
        ------
        WriteFailed
            If it has none and cannot be written anew.
        """
        self.look()
        if not self.astray:
            return self.path
        return self._moved_to() or self._saved(_beside(self.path))

    def bring(self, names: Iterable[Path]) -> None:
        """Have one of these names lead to the file, the first where that is free.

        Raises
        ------
        WriteFailed
            If it has none of them and cannot be written anew.
        """
        if self._descriptor < 0:
            return
        usual, *more = names
        with contextlib.suppress(OSError):
            if os.path.samestat(os.stat(usual), os.fstat(self._descriptor)):
                return
        self._saved((usual, *more))

    def close(self) -> None:
        """Let go of it."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _moved_to(self) -> Path | None:
        try:
            place = Path(os.readlink(OPEN_FILES / str(self._descriptor)))
            return place if os.path.samestat(os.stat(place), os.fstat(self._descriptor)) else None
        except OSError:
            return None

    def _saved(self, places: Iterable[Path]) -> Path:
        """Write the file anew under the first of these names that is free, and return it."""
        error: OSError = FileExistsError("every name is taken")
        for place in places:
            try:
                with open(place, "xb") as copy, os.fdopen(os.dup(self._descriptor), "rb") as log:
                    log.seek(0)
                    shutil.copyfileobj(log, copy)
                    copy.flush()
                    os.fsync(copy.fileno())
                return place
            except FileExistsError:
                continue
            except OSError as refused:
                error = refused
                break
        demand = f"{self.astray or self._what}, and it cannot be written anew ({one_line(error)})"
        raise WriteFailed(self.path, demand, "nothing of the recording could be kept") from error


def _beside(path: Path) -> Iterator[Path]:
    yield path
    for number in itertools.count(1):
        yield path.with_name(f"{path.stem}.saved{number}.wire")
