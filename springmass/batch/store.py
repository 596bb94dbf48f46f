"""The folder of a course: rows in parts, tables and page made of them, and a list of both with their digests.

1. A part is a file of JSON lines named by its SHA-256, written whole: one whose name and content differ is damaged, and
   so is one with a row that the schema refuses. Its runs are analysed again.
2. While runs are analysed, each batch becomes a part. When all are there, the rows are written anew in the order of
   the runs, a hundred to a part, and other parts are removed.
3. ``course.json`` lists the parts in their order, and the digest of every table and page that was written. It is
   written before a table takes its place: a table with another digest was edited, and is kept under another name.
4. The course is complete when ``course.json`` names what it was made of, and the parts are those that it lists.
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

__all__ = ["CSV", "PAGE", "PARQUET", "PART", "Store", "is_course", "open_course", "sha256_of", "table_rows"]

CSV, PARQUET, PAGE = "results.csv", "results.parquet", "index.html"
PARTS = "parts"
PART = 100  # rows of a part: what damage costs, and what is held in memory at a time
_LISTING = "course.json"
_LOCK = "lock"
_NAME = re.compile(r"rows-([0-9a-f]{64})\.jsonl")


class _Listing(Struct, forbid_unknown_fields=True, frozen=True):
    """What ``course.json`` holds.

    Parameters
    ----------
    made_of : str
        Digest of all that the tables and the page were made of; empty where they are not complete.
    tags : list of str
        The columns of the course's own.
    parts : list of str
        Names of the parts, in the order of the runs.
    outputs : mapping
        Digests by the name of the file: of the present one, and of the one that is about to replace it.
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
        Names of tables that were edited, and the names that they were given.

    Raises
    ------
    storage.errors.WriteFailed
        Of every method that writes, if it cannot.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.damaged: list[str] = []
        self.kept: list[tuple[str, str]] = []
        self._parts = folder / PARTS
        self._listing = _Listing()
        self._whole: list[str] = []  # names of the parts that are not damaged
        self._places: dict[str, list[tuple[str, int]]] = {}  # by run: part and line
        self._rows = functools.lru_cache(maxsize=4)(self._read_part)

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder for one pass; it is made if it is not there.

        Raises
        ------
        ProgramError
            With exit code 2 if another pass holds it.
        """
        with writing(self._parts):
            self._parts.mkdir(parents=True, exist_ok=True)
        if sys.platform == "win32":  # there are no such locks
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
                pass  # a network disk without locks
            yield

    def read_listing(self) -> None:
        """Read the listing; without one that can be read the course is not complete."""
        with contextlib.suppress(OSError, ValueRefused):
            text = read_regular(self._parts / _LISTING)
            self._listing = decoded(parsed(text, _LISTING), _Listing, _LISTING, 3)

    def read(self) -> None:
        """Read the listing and every part; note which parts are damaged."""
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
        """Yield the rows of a run, the latest first."""
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
        """Return the paths of all runs with a row."""
        return {row["path"] for name in self._whole for row in self._read_part(name)}

    @property
    def tags(self) -> tuple[str, ...]:
        """The columns of the course's own."""
        return tuple(self._listing.tags)

    def is_complete(self, made_of: str | None = None) -> bool:
        """Return whether all rows are there and tables were made of them, and, where it is given, of just this."""
        expected = self._listing.made_of if made_of is None else made_of
        return expected != "" and self._listing.made_of == expected and set(self._listing.parts) == set(self._names())

    def is_intact(self, name: str) -> bool:
        """Return whether a table or the page is there as it was written."""
        try:
            return sha256_of(self.folder / name) in self._listing.outputs.get(name, ())
        except OSError:
            return False

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows as a part."""
        self._add_places(self._write_part(rows), rows)

    def put_together(self, rows: Iterable[dict[str, Any]], tags: Sequence[str]) -> Iterator[dict[str, Any]]:
        """Write all rows in this order, and yield each one.

        After the last one all other parts are removed.
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
        """Note that tables and page are not complete."""
        if self._listing.made_of:
            self._list(made_of="")

    def complete(self, made_of: str) -> None:
        """Note that tables and page are complete, and what they were made of."""
        self._list(made_of=made_of)

    @contextlib.contextmanager
    def output(self, name: str) -> Iterator[Path]:
        """Give a temporary file to write, and put it in place of a table or the page when the ``with`` ends well.

        A file that this program did not write is kept under another name.
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
        """Give a table or page another name if it is neither what was written there nor has this digest."""
        path = self.folder / name
        try:
            standing = sha256_of(path)
        except OSError:
            return  # if a folder is in its place, the write that follows names it in its error
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
        """Return the rows of a part. Raises OSError and ValueRefused."""
        data = read_regular(self._parts / name)
        named = _NAME.fullmatch(name)
        if named is None or hashlib.sha256(data).hexdigest() != named[1]:
            raise ValueRefused("part", "checksum mismatch")
        return [checked_row(line, f"row {number}") for number, line in enumerate(data.splitlines(), 1)]


def sha256_of(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a regular file in hexadecimal digits."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _damage(path: Path, error: OSError | ValueRefused) -> str:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{path}: damaged ({reason}); springmass batch analyses its runs again"


def is_course(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder is one that ``springmass batch`` made."""
    return os.path.isdir(os.path.join(folder, PARTS))


def open_course(folder: str | os.PathLike[str]) -> Store:
    """Return a complete course.

    Raises
    ------
    ProgramError
        With exit code 2 if the folder holds none, 3 if it is not complete.
    """
    if not is_course(folder):
        raise ProgramError(f"{folder}: expected a folder that springmass batch made; name that of its -o", USAGE)
    store = Store(Path(folder))
    store.read_listing()
    if not store.is_complete():
        raise ProgramError(f"{folder}: the course is not complete; run springmass batch again", UNREADABLE)
    return store


def table_rows(store: Store) -> Iterator[dict[str, Any]]:
    """Yield the rows of a complete course by column, as its tables have them."""
    return (flat(row, row["run"], store.tags) for row in store.all())
