"""Recordings written in the forms that other programs read: MotionSensor.vi, LVM, and CSV with units.

Each form has room for less than a run file. What does not fit is told, never left out in silence.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from acquisition.block import F8, Block, Flag
from acquisition.errors import FormatError
from acquisition.recordings.tables.text import says_simulated
from acquisition.source import SourceInfo

__all__ = ["WRITERS", "Written", "write_csv", "write_lvm", "write_motion_sensor"]

_TITLE = "Motion Sensor Data File"
_SHOWN = np.uint8(Flag.MISSING)  # what NaN says as well


@dataclass(frozen=True, slots=True)
class Written:
    """Files made of one recording.

    Parameters
    ----------
    files : tuple of (str, bytes)
        What is added to the name that the user gave, and the content; empty for the file of that very name.
    lost : tuple of str
        What the form has no room for, one sentence each.
    """

    files: tuple[tuple[str, bytes], ...]
    lost: tuple[str, ...]


def write_motion_sensor(path: str, samples: Block, info: SourceInfo, title: str = "", start_time: str = "") -> Written:
    """Write the pair of files of MotionSensor.vi: position, and velocity beside it.

    Parameters
    ----------
    path : str
        For messages.
    samples : Block
    info : SourceInfo
    title, start_time : str
        As the recording has them; either may be empty.

    Returns
    -------
    Written
        The position under the name given, the velocity under ``_velocity`` added.

    Raises
    ------
    FormatError
        If two samples would get one time: the form prints milliseconds.

    Notes
    -----
    A velocity that the recording does not state is the backward difference over one sample, as the instrument
    computes it; behind a gap and beside a missing sample it is NaN.
    """
    _demand_times(path, samples.t, 3, "MotionSensor.vi prints times to 1 ms")
    head = title if title.lower().startswith(_TITLE.lower()) else f"{_TITLE} {title or start_time}".strip()
    head = " ".join(_said_simulated(head, info).split())
    velocity = _velocity(samples, info.rate_hz) if samples.velocity is None else samples.velocity
    error = "" if info.stated_error_m is None else f"\t{info.stated_error_m * 100:.3f}"
    columns = "Time (s)\tDistance (cm)" + ("\tDist Error (cm)" if error else "")
    position = (f"{t:.3f}\t{_fixed(x * 100, 3)}{error}" for t, x in _pairs(samples.t, samples.distance))
    speeds = (f"{t:.3f}\t{_fixed(v * 100, 3)}" for t, v in _pairs(samples.t, velocity))
    files = (
        ("", "\r\n".join([head, columns, *position]).encode()),
        ("_velocity", "\r\n".join([head, "Time (s)\tVelocity (cm/s)", *speeds]).encode()),
    )
    return Written(files, _lost(samples, rounding_m=1e-5))


def write_lvm(path: str, samples: Block, info: SourceInfo, title: str = "", start_time: str = "") -> Written:
    """Write LabVIEW Measurement: tabs, decimal points, one column of times; see :func:`write_motion_sensor`."""
    _demand_times(path, samples.t, 9, "LVM is written with times to 1 ns")
    channels = [("Distance", "m", samples.distance)]
    if samples.velocity is not None:
        channels.append(("Velocity", "m/s", samples.velocity))
    note = " ".join(_said_simulated(title, info).split())
    date, _, clock = (start_time or "1903-12-31T19:00:00").removesuffix("Z").partition("T")
    head: list[tuple[str, list[str]]] = [
        ("LabVIEW Measurement", []),
        ("Writer_Version", ["2"]),
        ("Reader_Version", ["2"]),
        ("Separator", ["Tab"]),
        ("Decimal_Separator", ["."]),
        ("Multi_Headings", ["No"]),
        ("X_Columns", ["One"]),
        ("Time_Pref", ["Relative"]),
        ("Operator", ["springmass"]),
        ("***End_of_Header***", []),
        ("", []),
        *([("Notes", [note])] if note else []),
        ("Channels", [str(len(channels))]),
    ]
    start = float(samples.t[0]) if len(samples) else 0.0
    cells = (
        ("Samples", str(len(samples))),
        ("Date", date.replace("-", "/")),
        ("Time", re.sub(r"[+-]\d\d:\d\d$", "", clock) or "00:00:00"),
        ("Y_Unit_Label", ""),
        ("X_Dimension", "Time"),
        ("X0", f"{start:.16E}"),
        ("Delta_X", f"{1 / info.rate_hz:.16E}"),
    )
    units = [unit for _, unit, _ in channels]
    head += [(key, units if key == "Y_Unit_Label" else [cell] * len(channels)) for key, cell in cells]
    head += [("***End_of_Header***", []), ("X_Value", [*(name for name, _, _ in channels), "Comment"])]
    lines = ["\t".join([key, *values]) for key, values in head]
    return Written((("", _rows(lines, "\t", samples.t, [values for _, _, values in channels])),), _lost(samples, 1e-9))


def write_csv(path: str, samples: Block, info: SourceInfo, title: str = "", start_time: str = "") -> Written:
    """Write columns under headings with units; see :func:`write_motion_sensor`.

    Simulated data say so in the heading, for the form has no other place.
    """
    _demand_times(path, samples.t, 9, "CSV is written with times to 1 ns")
    name = "Simulated distance (m)" if info.kind == "simulated" else "Distance (m)"
    headings, columns = ["Time (s)", name], [samples.distance]
    if samples.velocity is not None:
        headings.append("Velocity (m/s)")
        columns.append(samples.velocity)
    lost = [*_lost(samples, 1e-9), *(f"the {what} has no place" for what in _titles(title, start_time))]
    return Written((("", _rows([",".join(headings)], ",", samples.t, columns)),), tuple(lost))


WRITERS: dict[str, Callable[[str, Block, SourceInfo, str, str], Written]] = {
    ".txt": write_motion_sensor,
    ".lvm": write_lvm,
    ".csv": write_csv,
}
"""The writer of each suffix."""


def _rows(lines: list[str], mark: str, t: F8, columns: list[F8]) -> bytes:
    for row in zip(t.tolist(), *(column.tolist() for column in columns), strict=True):
        lines.append(mark.join(_fixed(value, 9) for value in row))
    return "\n".join([*lines, ""]).encode()


def _fixed(value: float, decimals: int) -> str:
    """Print fixed point, NaN as such, and no minus before zero."""
    if value != value:
        return "NaN"
    shown = f"{value:.{decimals}f}"
    return shown.removeprefix("-") if float(shown) == 0 else shown


def _pairs(t: F8, values: F8) -> Iterable[tuple[float, float]]:
    return zip(t.tolist(), values.tolist(), strict=True)


def _demand_times(path: str, t: F8, decimals: int, why: str) -> None:
    """Demand that the print tells apart all samples that the recording does."""
    printed = np.rint(t * 10.0**decimals)
    merged = int(np.count_nonzero((np.diff(printed) == 0) & (np.diff(t) != 0)))
    if merged:
        demand = f"expected times that can be told apart, got {merged} samples closer together: {why}"
        raise FormatError(path, demand, "write .csv, .lvm or a run file instead")


def _velocity(samples: Block, rate_hz: float) -> F8:
    velocity = np.full(len(samples), np.nan)
    if len(samples) > 1:
        whole = np.rint(np.diff(samples.t) * rate_hz) == 1
        velocity[1:] = np.where(whole, np.diff(samples.distance) * rate_hz, np.nan)
    return velocity


def _said_simulated(title: str, info: SourceInfo) -> str:
    if info.kind != "simulated" or says_simulated(title):
        return title
    return f"{title} (simulated)".strip()


def _titles(title: str, start_time: str) -> list[str]:
    return [what for what, value in (("title", title), ("start time", start_time)) if value]


def _lost(samples: Block, rounding_m: float) -> tuple[str, ...]:
    """Say what rows of numbers cannot say."""
    lost = []
    flagged = int(np.count_nonzero(samples.flags & ~_SHOWN))
    if flagged:
        lost.append(f"the flags of {flagged} samples have no place; their distances are written as they are")
    known = samples.distance[np.isfinite(samples.distance)]
    finer = int(np.count_nonzero(np.abs(np.rint(known / rounding_m) * rounding_m - known) > 1e-3 * rounding_m))
    if finer:
        lost.append(f"{finer} distances were rounded to {rounding_m:g} m")
    if samples.host_ns is not None:
        lost.append("the host's clock has no place")
    return tuple(lost)
