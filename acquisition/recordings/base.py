"""The interface of a family of recordings, and the reading of a file's bytes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from platformdirs import user_config_path

from acquisition.errors import FormatError
from acquisition.recordings.recording import Recording, Trap
from acquisition.regular_file import open_regular


@runtime_checkable
class Format(Protocol):
    """A family of recordings. Files are identified by content, not by suffix."""

    @property
    def name(self) -> str:
        """Name in the registry and on the command line."""
        ...

    @property
    def title(self) -> str:
        """One line for the user."""
        ...

    def recognises(self, head: bytes) -> bool:
        """Return whether the first 8192 bytes of a file show that it belongs to this family.

        This must be fast and never raise.
        """
        ...

    def read(
        self,
        path: str,
        data: bytes,
        *,
        channel: str | None = None,
        rate_hz: float | None = None,
        unit: str | None = None,
        run: str | None = None,
        time: str | None = None,
        time_unit: str | None = None,
    ) -> Recording:
        """Read one channel of one run of a file."""
        ...


@dataclass(frozen=True, slots=True)
class Survey:
    """One channel of a file, as far as the file describes it.

    ``rate_hz`` and ``span_s`` (from the earliest to the latest sample) are None if they cannot be determined, for
    example because the user must give the rate.
    """

    run: str
    channel: str
    unit: str
    samples: int
    rate_hz: float | None
    traps: tuple[Trap, ...]
    span_s: float | None = None


@runtime_checkable
class SurveyFormat(Protocol):
    """A family that states why it recognises a file and lists the channels of the file."""

    def evidence(self, head: bytes) -> str:
        """Return a few words on why a file belongs to this family, or an empty text if it does not."""
        ...

    def survey(self, path: str, data: bytes) -> tuple[Survey, ...]:
        """Return the description of every channel, as far as the file states it."""
        ...


def dialect_folder() -> Path:
    """Return the folder of a user's dialects inside the system's folder for settings."""
    return user_config_path("springmass", appauthor=False, roaming=True) / "dialects"


def read_bytes(path: str | os.PathLike[str], limit: int = -1) -> bytes:
    """Return the first bytes of a file, or all; raise an error if it cannot be read or is empty."""
    name = os.fspath(path)
    try:
        with open_regular(name) as file:
            data = file.read(limit)
    except OSError as error:
        problem = f"cannot be opened ({error.strerror or error})"
        raise FormatError(name, problem, "check its name and permissions") from error
    except ValueError as error:  # the name contains a NUL character
        raise FormatError(repr(name), f"not a valid file name ({error})", "check the name") from error
    if not data:
        raise FormatError(name, "expected a recording, got an empty file", "check that the export ended")
    return data
