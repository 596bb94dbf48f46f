"""Everything that your own package needs to add a sensor, a format, a damping law or an integrator.

These names are public: they keep their meaning until a changelog says otherwise, in a checkout and in an installed
wheel alike. Import them from here; the modules that define them may move.

Examples
--------
>>> from springmass.extend import Column, ColumnFormat, Formula, Header, Heading, Table, text_format
>>> from springmass.extend import Family, FramedDecoder, LineSplitter, Reading
>>> from springmass.extend import Law, Unit, make_law
>>> from springmass.extend import Integrator, OneStep, acceleration
"""

from __future__ import annotations

from typing import TYPE_CHECKING

# As in springmass/__init__.py, nothing is imported before its first use.
if TYPE_CHECKING:
    from acquisition.block import Block, Flag
    from acquisition.decoders.family import Decoder, Encoder, Family, Identity, Poll
    from acquisition.decoders.framed import FramedDecoder
    from acquisition.decoders.lines import LineSplitter
    from acquisition.decoders.sum_frames import SumFrames, with_sum
    from acquisition.errors import FormatError, NeedsAnswer, SensorError
    from acquisition.readings import Reading, Readings
    from acquisition.recordings.base import Format, SurveyFormat
    from acquisition.recordings.families.declared import dialect
    from acquisition.recordings.questions import Missing, MissingItem, Question
    from acquisition.recordings.recording import Original, Recording, Trap
    from acquisition.recordings.sampling.timing import Formula
    from acquisition.recordings.tables.format import ColumnFormat, text_format
    from acquisition.recordings.tables.headings import Heading
    from acquisition.recordings.tables.table import Column, Header, Table
    from acquisition.source import SourceInfo
    from pipeline.damping.laws.law import Law
    from pipeline.damping.laws.of_function import make_law
    from pipeline.dynamics import Equation, Integrator, Problem, Trajectory, get_integrator
    from pipeline.dynamics.halving import auto
    from pipeline.dynamics.methods import OneStep, acceleration
    from pipeline.errors import AnalysisError, DynamicsError
    from pipeline.numerics.quantity import Unit

__all__ = [
    "AnalysisError",
    "Block",
    "Column",
    "ColumnFormat",
    "Decoder",
    "DynamicsError",
    "Encoder",
    "Equation",
    "Family",
    "Flag",
    "Format",
    "FormatError",
    "Formula",
    "FramedDecoder",
    "Header",
    "Heading",
    "Identity",
    "Integrator",
    "Law",
    "LineSplitter",
    "Missing",
    "MissingItem",
    "NeedsAnswer",
    "OneStep",
    "Original",
    "Poll",
    "Problem",
    "Question",
    "Reading",
    "Readings",
    "Recording",
    "SensorError",
    "SourceInfo",
    "SumFrames",
    "SurveyFormat",
    "Table",
    "Trajectory",
    "Trap",
    "Unit",
    "acceleration",
    "auto",
    "dialect",
    "get_integrator",
    "make_law",
    "text_format",
    "with_sum",
]

_WHERE = {
    "acquisition.block": ("Block", "Flag"),
    "acquisition.decoders.family": ("Decoder", "Encoder", "Family", "Identity", "Poll"),
    "acquisition.decoders.framed": ("FramedDecoder",),
    "acquisition.decoders.lines": ("LineSplitter",),
    "acquisition.decoders.sum_frames": ("SumFrames", "with_sum"),
    "acquisition.errors": ("FormatError", "NeedsAnswer", "SensorError"),
    "acquisition.readings": ("Reading", "Readings"),
    "acquisition.recordings.base": ("Format", "SurveyFormat"),
    "acquisition.recordings.families.declared": ("dialect",),
    "acquisition.recordings.questions": ("Missing", "MissingItem", "Question"),
    "acquisition.recordings.recording": ("Original", "Recording", "Trap"),
    "acquisition.recordings.sampling.timing": ("Formula",),
    "acquisition.recordings.tables.format": ("ColumnFormat", "text_format"),
    "acquisition.recordings.tables.headings": ("Heading",),
    "acquisition.recordings.tables.table": ("Column", "Header", "Table"),
    "acquisition.source": ("SourceInfo",),
    "pipeline.damping.laws.law": ("Law",),
    "pipeline.damping.laws.of_function": ("make_law",),
    "pipeline.dynamics": ("Equation", "Integrator", "Problem", "Trajectory", "get_integrator"),
    "pipeline.dynamics.halving": ("auto",),
    "pipeline.dynamics.methods": ("OneStep", "acceleration"),
    "pipeline.errors": ("AnalysisError", "DynamicsError"),
    "pipeline.numerics.quantity": ("Unit",),
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    module = next((module for module, names in _WHERE.items() if name in names), None)
    if module is None:
        raise AttributeError(f"module 'springmass.extend' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(module), name)


def __dir__() -> list[str]:
    return sorted(__all__)
