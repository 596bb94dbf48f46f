"""A recording that was read, with its scene, origin and digest, and its track, which ``--from`` and ``--to`` cut."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.block import Block, SourceInfo
from acquisition.recordings.recording import FormatIssue, Original, Recording
from acquisition.regular_file import open_regular
from pipeline.track import Track
from springmass.errors import UNREADABLE, ProgramError
from springmass.loading.options import AnalysisOptions
from springmass.loading.track import between, to_track
from storage.run_file.reading import open_run

UNVERIFIED = "unverified"


@dataclass(frozen=True, eq=False)
class Loaded:
    """One input that has been read: its recording, and what is known of it besides.

    ``format`` is the family that read it, "run" for a run file, "wire" for a wire log, "memory" for arrays; the format
    of the recording is the family of what is inside a run file. ``scene`` comes from the notes next to the file, or
    else from inside a run file. ``sha256`` is the digest of the file's bytes, empty for arrays and for an empty wire
    log. With ``originals_inside`` the original files are inside the run file, and are read when they are needed.
    ``reading`` are the options with which the file was read, by name. The track has the samples from ``from_s`` to
    ``to_s``; ``clock_ppm`` is the stated rate error of the sensor's clock.
    """

    recording: Recording
    format: str
    scene: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    sha256: str = ""
    originals_inside: bool = False
    reading: Mapping[str, Any] = field(default_factory=dict)
    from_s: float = -math.inf
    to_s: float = math.inf
    clock_ppm: float | None = None

    @property
    def path(self) -> Path:
        """The path of the file; that of the current folder for arrays."""
        return Path(self.recording.path)

    @property
    def info(self) -> SourceInfo:
        """Rate, quantum, clock and kind."""
        return self.recording.info

    @property
    def channel(self) -> str:
        """The quantity or column whose values are the samples."""
        return self.recording.channel

    @property
    def title(self) -> str:
        """The title line of the file; empty without one."""
        return self.recording.title

    @property
    def traps(self) -> tuple[FormatIssue, ...]:
        """The remarks of the reader."""
        return self.recording.traps

    @property
    def samples(self) -> Block:
        """All samples as they were recorded."""
        return self.recording.samples

    @cached_property
    def track(self) -> Track:
        """The samples that the pipeline analyses."""
        recording = self.recording
        track = to_track(self.samples, self.info, recorded_format=recording.format, provenance=self.provenance)
        track = between(track, self.from_s, self.to_s)
        if self.clock_ppm is None:
            return track
        bound = 1e-6 * self.clock_ppm
        return replace(track, clock_limit=bound, u_clock=bound / math.sqrt(3.0))

    @property
    def source(self) -> str:
        """The path as it was given; empty for arrays, which have none."""
        return "" if self.path == Path() else str(self.path)

    @property
    def originals(self) -> tuple[Original, ...]:
        """Exact copies of the original files; those inside a run file are checked as they are read."""
        if not self.originals_inside:
            return self.recording.originals
        if sha256_of(self.path) != self.sha256:
            raise ProgramError(f"{self.path}: the file has changed since it was loaded", "load it again", UNREADABLE)
        with open_run(self.path, unverified=any(trap.code == UNVERIFIED for trap in self.traps)) as run:
            return run.originals()

    def within(self, options: AnalysisOptions) -> Loaded:
        """Return the input with the chosen seconds of its track, and with the stated error of its clock."""
        low = -math.inf if options.from_s is None else options.from_s
        high = math.inf if options.to_s is None else options.to_s
        ppm = self.clock_ppm if options.clock_ppm is None else options.clock_ppm
        part = replace(self, from_s=max(low, self.from_s), to_s=min(high, self.to_s), clock_ppm=ppm)
        if (options.from_s, options.to_s) != (None, None) and not len(part.track):
            times = self.track.t[np.isfinite(self.track.t)]
            span = f"spans {times.min():g} to {times.max():g} s" if times.size else "holds no sample"
            where = self.source or "arrays"
            raise ProgramError(f"{where}: no sample lies between {low:g} and {high:g} s", f"the record {span}")
        return part


def sha256_of(path: Path) -> str:
    """Return the digest of a file's bytes."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
