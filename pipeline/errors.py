"""The exception hierarchy of the pipeline.

::

    PipelineError
    |-- SceneError      a scene contains an impossible value (file, key, value, what is allowed)
    |-- TrackError      arrays do not form a track: different lengths, not one-dimensional, an unknown quantity
    |-- AnalysisError   a stage cannot process a track (too short, no motion)
    `-- DynamicsError   a motion cannot be computed: coefficient, start, step, tolerance or method

Every message is one line. It says where the error is, what is wrong, which value was given, and what to do.
"""

from __future__ import annotations

from failure import Error


class PipelineError(Error):
    """Base class of all errors that the pipeline raises; the message is a single line for the user."""


class SceneError(PipelineError):
    """A scene with an unknown key, a wrong unit, or an impossible value."""


class TrackError(PipelineError):
    """Arrays that do not form a track."""


class AnalysisError(PipelineError):
    """A track that a stage cannot process; the message says why."""


class DynamicsError(PipelineError):
    """A motion that cannot be computed: an invalid coefficient, start, step, tolerance or method, or a divergence."""
