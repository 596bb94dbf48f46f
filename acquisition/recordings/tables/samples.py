"""The samples of a chosen channel in SI units, and the recording that they make."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from acquisition.block import B1, F8, I8, U8, Block, ClockKind, SourceInfo, SourceKind
from acquisition.recordings.recording import FormatIssue, Original, Recording
from acquisition.recordings.sampling.timing import Timing
from acquisition.recordings.tables.table import Column, Table
from acquisition.recordings.tables.text import says_simulated
from acquisition.units import Measure


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The samples of a chosen channel in SI units, and the remarks on them and on the file.

    ``resolution`` is the size of the last printed digit of a value. ``lines`` are the line numbers of the samples, None
    for a binary file. ``sound`` marks the rows of the table that could be read. ``quantum`` is the step of which all
    values are multiples, and ``error_m`` the usual error that the file states.
    """

    path: str
    table: Table
    column: Column
    measured: Measure
    t: F8
    value: F8
    flags: U8
    timing: Timing
    resolution: float
    traps: tuple[FormatIssue, ...]
    lines: I8 | None
    sound: B1
    quantum: float | None = None
    error_m: float | None = None

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return PurePath(self.path).name

    def recording(self, family: str, data: bytes, block: Block, more: Iterable[FormatIssue] = ()) -> Recording:
        """Return the recording of a block, which is made of these samples."""
        table, column, name = self.table, self.column, self.name
        kind: SourceKind = (
            "simulated" if says_simulated(f"{table.title} {table.run} {column.name} {name}") else "replay"
        )
        clock: ClockKind = "device" if self.timing.origin_s is None else "nominal"
        return Recording(
            format=family,
            path=self.path,
            info=SourceInfo(
                kind, name, self.timing.rate_hz, None, self.quantum, clock, self.error_m, self.timing.u_rate
            ),
            channel=column.name,
            samples=block,
            traps=(*self.traps, *more),
            malformed_rows=int(np.count_nonzero(~self.sound)),
            originals=(Original(name, data),),
            title=table.title,
            run=table.run,
            start_time=table.start_time,
        )
