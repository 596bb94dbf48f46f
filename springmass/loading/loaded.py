"""A recording that was read: its samples and track, its scene, and its original files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import FormatIssue, Original
from acquisition.regular_file import open_regular
from pipeline.track import Track
from springmass.errors import UNREADABLE, ProgramError
from storage.run_file.reading import open_run

UNVERIFIED = "unverified"


@dataclass(frozen=True, eq=False)
class Loaded:
    """One input that has been read: the samples as they were recorded, and the track that the pipeline analyses.

    ``format`` is the family that read it, "run" for a run file, "wire" for a wire log, "memory" for arrays;
    ``recorded_format`` is the family of the recording inside a run file. ``scene`` comes from the notes next to the
    file, or else from inside a run file. ``kept`` are the original files; those inside a run file are read when they
    are needed. ``reading`` are the options with which the file was read, by name. ``sha256`` is the digest of the
    file's bytes, empty for arrays and for an empty wire log.
    """

    path: Path
    format: str
    info: SourceInfo
    channel: str
    title: str
    samples: Block
    track: Track
    traps: tuple[FormatIssue, ...] = ()
    malformed_rows: int = 0
    scene: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    recorded_format: str = ""
    sha256: str = ""
    kept: tuple[Original, ...] | None = ()
    reading: Mapping[str, Any] = field(default_factory=dict)

    @property
    def originals(self) -> tuple[Original, ...]:
        """Exact copies of the original files; those inside a run file are checked as they are read."""
        if self.kept is not None:
            return self.kept
        if sha256_of(self.path) != self.sha256:
            raise ProgramError(f"{self.path}: the file has changed since it was loaded; load it again", UNREADABLE)
        with open_run(self.path, unverified=any(trap.code == UNVERIFIED for trap in self.traps)) as run:
            return run.originals()

    def samples_in_blocks(self, size: int = 1024) -> Iterator[Block]:
        """Yield the samples in blocks of at most ``size``."""
        for start in range(0, len(self.samples), size):
            yield self.samples[start : start + size]


def sha256_of(path: Path) -> str:
    """Return the digest of a file's bytes."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
