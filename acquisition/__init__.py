"""From a port or an old file to blocks of samples; knows nothing of the rest."""

from acquisition.block import Block, Flag, concatenate
from acquisition.clock import Clock, SystemClock, VirtualClock
from acquisition.errors import AcquisitionError, FormatError, NeedsAnswer, SourceError, UnknownFormat
from acquisition.recording import Original, Recording, Trap
from acquisition.registry import formats, open_recording, sniff
from acquisition.replay import Replay
from acquisition.source import Source, SourceInfo

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
