"""The folder of a course: parts with rows, tables and page made from them, and a list of both with their digests.

1. A part is a file of JSON lines named by its SHA-256 digest and written atomically. It is damaged if its name does not
   match its content, or if the schema refuses one of its rows. The runs of a damaged part are analysed again.
2. While runs are analysed, each batch becomes a part. When all runs have a row, the rows are rewritten in the order of
   the runs, a hundred rows per part, and all other parts are removed.
3. ``course.json`` lists the parts in order, and the digest of every table and page that was written. It is updated
   before a table is replaced. A table with a different digest was edited, and is kept under another name.
4. The course is complete if ``course.json`` states the digest of its inputs and lists exactly the existing parts.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct, field

from acquisition.regular_file import open_regular, read_regular
from springmass.batch.plan import Job
from springmass.batch.rows import Digest, NoDigest, Tag, checked_row, dumped, flat
from springmass.errors import UNREADABLE, USAGE, ProgramError
from storage.atomic import whole_file, write_whole, writing
from storage.schema import ValueRefused, decoded, parsed

if sys.platform != "win32":
    import fcntl

__all__ = ["CSV", "GROUPS", "PAGE", "PARQUET", "PART", "Store", "is_course", "open_course", "sha256_of", "table_rows"]

CSV, PARQUET, PAGE, GROUPS = "results.csv", "results.parquet", "index.html", "groups.txt"
PARTS = "parts"
PART = 100  # rows per part, which limits the loss by damage and the memory used at a time
_LISTING = "course.json"
_LOCK = "lock"
_NAME = re.compile(r"rows-([0-9a-f]{64})\.jsonl")


class _Listing(Struct, forbid_unknown_fields=True, frozen=True):
    """The contents of ``course.json``.

    Parameters
    ----------
    made_of : str
        Digest of the inputs from which the tables and the page were made; empty if they are not complete.
    tags : list of str
        The course's own columns.
    parts : list of str
        Names of the parts, in the order of the runs.
    outputs : mapping
        By file name, the digests of the existing file and of the file that is about to replace it.
    """

    made_of: NoDigest = ""
    tags: list[Tag] = field(default_factory=list)
    parts: list[Annotated[str, Meta(pattern=f"^{_NAME.pattern}$")]] = field(default_factory=list)
    outputs: dict[str, list[Digest]] = field(default_factory=dict)


class Store:
    """The folder of a course.

    Parameters
    ----------
    folder : Path

    Attributes
    ----------
    damaged : list of str
        One line for each part that cannot be read or has a checksum mismatch.
    kept : list of (str, str)
        Names of edited tables or page, with the names under which they are kept.

    Raises
    ------
    storage.errors.WriteFailed
        By every method that writes, if writing fails.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.damaged: list[str] = []
        self.kept: list[tuple[str, str]] = []
        self._parts = folder / PARTS
        self._listing = _Listing()
        self._whole: list[str] = []  # names of the parts that are not damaged
        self._places: dict[str, list[tuple[str, int]]] = {}  # part and line of each row, by run
        self._rows = functools.lru_cache(maxsize=4)(self._read_part)

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Lock the folder for one pass, and create it if it does not exist.

        Raises
        ------
        ProgramError
            With exit code 2 if another pass has locked it.
        """
        with writing(self._parts):
            self._parts.mkdir(parents=True, exist_ok=True)
        if sys.platform == "win32":  # Windows has no such locks
            yield
            return
        with writing(self._parts / _LOCK):
            file = (self._parts / _LOCK).open("ab")
        with file as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise ProgramError(
                    f"{self.folder}: another pass is using this folder; wait for its end", USAGE
                ) from error
            except OSError:
                pass  # a network drive without locks
            yield

    def read_listing(self) -> None:
        """Read the listing; if it cannot be read, the course counts as incomplete."""
        with contextlib.suppress(OSError, ValueRefused):
            text = read_regular(self._parts / _LISTING)
            self._listing = decoded(parsed(text, _LISTING), _Listing, _LISTING)

    def read(self) -> None:
        """Read the listing and every part, and record which parts are damaged."""
        self.read_listing()
        listed = {name: number for number, name in enumerate(self._listing.parts)}
        for name in sorted(self._names(), key=lambda name: (listed.get(name, len(listed)), name)):
            try:
                rows = self._read_part(name)
            except (OSError, ValueRefused) as error:
                self.damaged.append(_damage(self._parts / name, error))
            else:
                self._add_places(name, rows)

    def rows(self, key: str) -> Iterator[dict[str, Any]]:
        """Yield the rows of a run, starting with the latest."""
        for name, number in reversed(self._places.get(key, ())):
            yield self._rows(name)[number]

    def all(self) -> Iterator[dict[str, Any]]:
        """Yield every row of a complete course, in the order of the runs.

        Raises
        ------
        ProgramError
            With exit code 3 if a part is damaged.
        """
        for name in self._listing.parts:
            try:
                yield from self._read_part(name)
            except (OSError, ValueRefused) as error:
                raise ProgramError(_damage(self._parts / name, error), UNREADABLE) from error

    def paths(self) -> set[str]:
        """Return the paths of all runs that have a row."""
        return {row["path"] for name in self._whole for row in self._read_part(name)}

    @property
    def tags(self) -> tuple[str, ...]:
        """The course's own columns."""
        return tuple(self._listing.tags)

    def is_complete(self, made_of: str | None = None) -> bool:
        """Return whether rows and tables are complete and, if ``made_of`` is given, were made from these inputs."""
        expected = self._listing.made_of if made_of is None else made_of
        return expected != "" and self._listing.made_of == expected and set(self._listing.parts) == set(self._names())

    def is_intact(self, name: str) -> bool:
        """Return whether a table or the page exists and is unchanged since it was written."""
        try:
            return sha256_of(self.folder / name) in self._listing.outputs.get(name, ())
        except OSError:
            return False

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows as a part."""
        self._add_places(self._write_part(rows), rows)

    def put_together(self, rows: Iterable[dict[str, Any]], tags: Sequence[str]) -> Iterator[dict[str, Any]]:
        """Write all rows in the given order, and yield each one.

        After the last row, all other parts are removed.
        """
        names, part = [], []
        for row in rows:
            part.append(row)
            yield row
            if len(part) == PART:
                names.append(self._write_part(part))
                part = []
        if part:
            names.append(self._write_part(part))
        self._list(tags=list(tags), parts=names)
        for name in set(self._names()) - set(names):
            with writing(self._parts / name):
                (self._parts / name).unlink()

    def begin(self) -> None:
        """Record that tables and page are not complete."""
        if self._listing.made_of:
            self._list(made_of="")

    def complete(self, made_of: str) -> None:
        """Record that tables and page are complete, with the digest of their inputs."""
        self._list(made_of=made_of)

    @contextlib.contextmanager
    def output(self, name: str) -> Iterator[Path]:
        """Yield a temporary file, which replaces a table or the page if the ``with`` block succeeds.

        An existing file that this program did not write is kept under another name.
        """
        with whole_file(self.folder / name) as temporary:
            yield temporary
            with writing(self.folder / name):
                digest = sha256_of(temporary)
            self.keep_edited(name, digest)
            before = self._listing.outputs.get(name, [])
            self._list(outputs={**self._listing.outputs, name: [*before, digest]})
        self._list(outputs={**self._listing.outputs, name: [digest]})

    def keep_edited(self, name: str, digest: str = "") -> None:
        """Rename a table or page if its digest is neither the given one nor one recorded when it was written."""
        path = self.folder / name
        try:
            standing = sha256_of(path)
        except OSError:
            return  # if the path is a folder, the error of the write that follows names it
        if standing == digest or standing in self._listing.outputs.get(name, ()):
            return
        ends = (".edited" if number == 1 else f".edited-{number}" for number in count(1))
        free = next(place for end in ends if not os.path.lexists(place := self.folder / f"{name}{end}"))
        with writing(path):
            os.replace(path, free)
        self.kept.append((name, free.name))

    def _list(self, **changes: Any) -> None:
        self._listing = msgspec.structs.replace(self._listing, **changes)
        write_whole(self._parts / _LISTING, f"{dumped(msgspec.to_builtins(self._listing))}\n")

    def _names(self) -> list[str]:
        with contextlib.suppress(OSError):
            return sorted(name for name in os.listdir(self._parts) if name.endswith(".jsonl"))
        return []

    def _add_places(self, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
        self._whole.append(name)
        for number, row in enumerate(rows):
            self._places.setdefault(Job.from_mapping(row["job"], "").key, []).append((name, number))

    def _write_part(self, rows: Sequence[Mapping[str, Any]]) -> str:
        data = b"".join(f"{dumped(row)}\n".encode("utf-8", "backslashreplace") for row in rows)
        return write_whole(self._parts / f"rows-{hashlib.sha256(data).hexdigest()}.jsonl", data).name

    def _read_part(self, name: str) -> list[dict[str, Any]]:
        """Return the rows of a part; raise OSError or ValueRefused if it is unreadable or damaged."""
        data = read_regular(self._parts / name)
        named = _NAME.fullmatch(name)
        if named is None or hashlib.sha256(data).hexdigest() != named[1]:
            raise ValueRefused("part", "checksum mismatch")
        return [checked_row(line, f"row {number}") for number, line in enumerate(data.splitlines(), 1)]


def sha256_of(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 digest of a regular file in hexadecimal digits."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _damage(path: Path, error: OSError | ValueRefused) -> str:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{path}: damaged ({reason}); springmass batch analyses its runs again"


def is_course(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder was made by ``springmass batch``."""
    return os.path.isdir(os.path.join(folder, PARTS))


def open_course(folder: str | os.PathLike[str]) -> Store:
    """Return a complete course.

    Raises
    ------
    ProgramError
        With exit code 2 if the folder contains no course, 3 if the course is not complete.
    """
    if not is_course(folder):
        raise ProgramError(f"{folder}: expected a folder that springmass batch made; name that of its -o", USAGE)
    store = Store(Path(folder))
    store.read_listing()
    if not store.is_complete():
        raise ProgramError(f"{folder}: the course is not complete; run springmass batch again", UNREADABLE)
    return store


def table_rows(store: Store) -> Iterator[dict[str, Any]]:
    """Return an iterator over the rows of a complete course by column, as in its tables."""
    return (flat(row, row["run"], store.tags) for row in store.all())
