"""Write recordings in the formats of other programs: MotionSensor.vi, and CSV with units.

Each format stores less than a run file. Everything that it cannot store is reported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, Block, Flag, SourceInfo
from acquisition.errors import FormatError
from acquisition.recordings.tables.text import says_simulated

_TITLE = "Motion Sensor Data File"
_SHOWN = np.uint8(Flag.MISSING)  # this flag is not lost, because a NaN represents it


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """The files written for one recording.

    ``files`` are the suffix that is added to the user's file name (empty for the file with that name) and the content.
    ``lost`` has one sentence for each kind of information that the format cannot store.
    """

    files: tuple[tuple[str, bytes], ...]
    lost: tuple[str, ...]


def write_motion_sensor(
    path: str, samples: Block, info: SourceInfo, title: str = "", start_time: str = ""
) -> WrittenFiles:
    """Write the pair of files of MotionSensor.vi: position, and velocity with the suffix ``_velocity``.

    If the recording has no velocity, the backward difference of the position over one sample is written, as in the
    instrument. It is NaN after a gap and next to a missing sample.
    """
    _demand_times(path, samples.t, 3, "MotionSensor.vi prints times to 1 ms")
    head = title if title.lower().startswith(_TITLE.lower()) else f"{_TITLE} {title or start_time}".strip()
    head += " (simulated)" if info.kind == "simulated" and not says_simulated(head) else ""
    head, velocity = " ".join(head.split()), samples.velocity
    if velocity is None:
        whole = np.rint(np.diff(samples.t, prepend=np.nan) * info.rate_hz) == 1
        velocity = np.where(whole, np.diff(samples.distance, prepend=np.nan) * info.rate_hz, np.nan)
    error = "" if info.stated_error_m is None else f"\t{info.stated_error_m * 100:.3f}"
    columns = "Time (s)\tDistance (cm)" + ("\tDist Error (cm)" if error else "")

    def file(columns: str, values: F8, end: str = "") -> bytes:
        pairs = zip(samples.t.tolist(), values.tolist(), strict=True)
        return "\r\n".join([head, columns, *(f"{t:.3f}\t{_fixed(x * 100, 3)}{end}" for t, x in pairs)]).encode()

    files = ("", file(columns, samples.distance, error)), ("_velocity", file("Time (s)\tVelocity (cm/s)", velocity))
    return WrittenFiles(files, _losses(samples, rounding_m=1e-5))


def write_csv(path: str, samples: Block, info: SourceInfo, title: str = "", start_time: str = "") -> WrittenFiles:
    """Write columns under headings with units; see :func:`write_motion_sensor`.

    The heading marks simulated data, because the format has no other place for this information.
    """
    _demand_times(path, samples.t, 9, "CSV is written with times to 1 ns")
    name = "Simulated distance (m)" if info.kind == "simulated" else "Distance (m)"
    headings, columns = ["Time (s)", name], [samples.distance]
    if samples.velocity is not None:
        headings.append("Velocity (m/s)")
        columns.append(samples.velocity)
    titles = [what for what, value in (("title", title), ("start time", start_time)) if value]
    lost = [*_losses(samples, 1e-9), *(f"CSV cannot store the {what}" for what in titles)]
    rows = zip(samples.t.tolist(), *(column.tolist() for column in columns), strict=True)
    lines = [",".join(headings), *(",".join(_fixed(value, 9) for value in row) for row in rows), ""]
    return WrittenFiles((("", "\n".join(lines).encode()),), tuple(lost))


WRITERS: dict[str, Callable[[str, Block, SourceInfo, str, str], WrittenFiles]] = {
    ".txt": write_motion_sensor,
    ".csv": write_csv,
}
"""The writer for each file suffix."""


def _fixed(value: float, decimals: int) -> str:
    """Return a number in fixed-point notation, NaN as "NaN", and zero without a minus sign."""
    if value != value:
        return "NaN"
    shown = f"{value:.{decimals}f}"
    return shown.removeprefix("-") if float(shown) == 0 else shown


def _demand_times(path: str, t: F8, decimals: int, why: str) -> None:
    """Check that no two samples with different times get the same printed time."""
    printed = np.rint(t * 10.0**decimals)
    merged = int(np.count_nonzero((np.diff(printed) == 0) & (np.diff(t) != 0)))
    if merged:
        problem = f"{why}, but {merged} samples are closer together"
        raise FormatError(path, problem, "write .csv or a run file instead")


def _losses(samples: Block, rounding_m: float) -> tuple[str, ...]:
    """Return one sentence for each kind of information that rows of numbers cannot store."""
    lost = []
    flagged = int(np.count_nonzero(samples.flags & ~_SHOWN))
    if flagged:
        those = "1 sample" if flagged == 1 else f"{flagged} samples"
        lost.append(f"the flags of {those} cannot be stored; the distances are unchanged")
    measured = samples.distance[np.isfinite(samples.distance)]
    finer = int(np.count_nonzero(np.abs(np.rint(measured / rounding_m) * rounding_m - measured) > 1e-3 * rounding_m))
    if finer:
        lost.append(f"{finer} distance{'s were' if finer > 1 else ' was'} rounded to {rounding_m:g} m")
    if samples.host_ns is not None:
        lost.append("the host's clock cannot be stored")
    return tuple(lost)
