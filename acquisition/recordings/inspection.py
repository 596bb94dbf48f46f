"""What a file is and what it holds, before anything of it is taken as a recording."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.recordings.recording import Trap

__all__ = ["Inspection", "Survey"]


@dataclass(frozen=True, slots=True)
class Survey:
    """What one channel of a file is, as far as the file says it by itself.

    Parameters
    ----------
    run, channel, unit : str
        Empty where the file does not say.
    samples : int
    rate_hz : float or None
        None where it must be given.
    traps : tuple of Trap
    span_s : float or None
        From the first time to the last; None where they must be given.
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
    """What a file is and what it holds.

    Parameters
    ----------
    format, title : str
        Name of the family, and one line on it.
    why : str
        By what the file was told to be of it.
    surveys : tuple of Survey
        One for each channel of each run; empty where the family does not tell.
    """

    format: str
    title: str
    why: str
    surveys: tuple[Survey, ...]
