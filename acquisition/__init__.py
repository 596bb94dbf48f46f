"""From a port or an old file to blocks of samples; knows nothing of the rest."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from acquisition.block import Block, Flag, concatenate
from acquisition.errors import AcquisitionError, FormatError, NeedsAnswer, SourceError, UnknownFormat
from acquisition.recordings.identify import formats, open_recording, sniff
from acquisition.recordings.recording import Original, Recording, Trap
from acquisition.source import Source, SourceInfo

if TYPE_CHECKING:
    from acquisition.clock import Clock, SystemClock, VirtualClock
    from acquisition.replay import Replay

__all__ = [
    "AcquisitionError",
    "Block",
    "Clock",
    "Flag",
    "FormatError",
    "NeedsAnswer",
    "Original",
    "Recording",
    "Replay",
    "Source",
    "SourceError",
    "SourceInfo",
    "SystemClock",
    "Trap",
    "UnknownFormat",
    "VirtualClock",
    "concatenate",
    "formats",
    "open_recording",
    "sniff",
]

# What no file is read with: it would be a tenth of a cold start's imports.
_LATER = {"Clock": "clock", "SystemClock": "clock", "VirtualClock": "clock", "Replay": "replay"}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"acquisition.{_LATER[name]}"), name)
