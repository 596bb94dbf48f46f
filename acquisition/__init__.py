"""Turn bytes from a port or a recording into blocks of samples; no other package of the project is imported."""

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

# Reading files does not need these names; importing them eagerly would take a tenth of the start-up time.
_LATER = {"Clock": "clock", "SystemClock": "clock", "VirtualClock": "clock", "Replay": "replay"}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"acquisition.{_LATER[name]}"), name)
