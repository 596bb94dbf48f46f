"""The format and the content of a file, before a channel is chosen."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.recordings.recording import Trap

__all__ = ["Inspection", "Survey"]


@dataclass(frozen=True, slots=True)
class Survey:
    """One channel of a file, as far as the file describes it.

    Parameters
    ----------
    run, channel, unit : str
        Empty if the file does not state them.
    samples : int
    rate_hz : float or None
        Sampling rate, Hz; None if it cannot be determined, for example because the user must give it.
    traps : tuple of Trap
    span_s : float or None
        Duration from the earliest to the latest sample, s; None if it is not known.
    """

    run: str
    channel: str
    unit: str
    samples: int
    rate_hz: float | None
    traps: tuple[Trap, ...]
    span_s: float | None = None


@dataclass(frozen=True, slots=True)
class Inspection:
    """The format and the content of a file.

    Parameters
    ----------
    format, title : str
        Name of the family, and its description in one line.
    why : str
        The evidence for the family.
    surveys : tuple of Survey
        One for each channel of each run; empty if the family cannot list them.
    """

    format: str
    title: str
    why: str
    surveys: tuple[Survey, ...]
