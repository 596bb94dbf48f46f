"""Everything that your own package needs to add a sensor, a format, a damping law or an integrator.

These names are public: they keep their meaning until a changelog says otherwise, in a checkout and in an installed
wheel alike. Import them from here; the modules that define them may move. :mod:`springmass.testing` checks what you
add.
"""

from typing import TYPE_CHECKING

from acquisition.block import Block, Flag, SourceInfo
from acquisition.clock import Clock, SystemClock, VirtualClock
from acquisition.decoders.decoder import Decoder, Encoder, Identity
from acquisition.decoders.frames import FramedDecoder, LineSplitter, SumFrames, with_sum
from acquisition.decoders.sensor import Poll, Sensor
from acquisition.errors import FormatError, NeedsAnswer, SensorError
from acquisition.readings import Reading, Readings
from acquisition.recordings.families.user_dialects import dialect
from acquisition.recordings.questions import Missing, MissingItem, Question
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Format, FormatIssue, Original, Recording, SurveyFormat
from acquisition.recordings.sampling.timing import Formula
from acquisition.recordings.tables.format import ColumnFormat, text_format
from acquisition.recordings.tables.headings import Heading
from acquisition.recordings.tables.table import Column, Header, Table
from pipeline.damping.laws.law import Law
from pipeline.damping.laws.of_function import make_law
from pipeline.errors import AnalysisError, DynamicsError
from pipeline.simulation import Equation, Integrator, Problem, Trajectory, get_integrator
from pipeline.simulation.halving import auto
from pipeline.simulation.methods import OneStep, acceleration
from pipeline.units import Unit

# fmt: off
__all__ = [
    "AnalysisError", "Block", "Clock", "Column", "ColumnFormat", "Decoder", "DynamicsError", "Encoder", "Equation",
    "Flag", "Format", "FormatError", "FormatIssue", "Formula", "FramedDecoder", "Header", "Heading", "Identity",
    "Integrator", "Law", "LineSplitter", "Missing", "MissingItem", "NeedsAnswer", "OneStep", "Original", "Poll",
    "Problem", "Question", "ReadOptions", "Reading", "Readings", "Recording", "Sensor", "SensorError", "SourceInfo",
    "SumFrames", "SurveyFormat", "SystemClock", "Table", "Trajectory", "Unit", "VirtualClock", "acceleration", "auto",
    "dialect", "get_integrator", "make_law", "text_format", "with_sum",
]
# fmt: on

if not TYPE_CHECKING:
    _UNTIL_0_4 = {"Family": "Sensor", "Trap": "FormatIssue"}
    """Names of earlier versions, each with its name since 0.4, in which the earlier ones are imported last."""

    def __getattr__(name):
        import warnings

        if name not in _UNTIL_0_4:
            raise AttributeError(f"module 'springmass.extend' has no attribute {name!r}")
        message = f"springmass.extend.{name} is {_UNTIL_0_4[name]} since 0.4; import it by that name"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return globals()[_UNTIL_0_4[name]]
