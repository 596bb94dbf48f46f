"""The error tree of the pipeline.

::

    PipelineError
    |-- SceneError      a scene says something impossible (file, key, value, what is allowed)
    |-- TrackError      arrays that are no track: lengths differ, no finite sample, not one-dimensional
    |-- AnalysisError   a track that a stage cannot work on (too short, no motion)
    `-- DynamicsError   a motion that cannot be computed: coefficient, start, step, tolerance or method

Every message is one line: where, what is wrong, what was given, and what to do.
"""

from __future__ import annotations

__all__ = ["AnalysisError", "DynamicsError", "PipelineError", "SceneError", "TrackError"]


class PipelineError(Exception):
    """Anything that the pipeline refuses; its text is a single line meant for the user."""


class SceneError(PipelineError):
    """A scene with an unknown key, a wrong unit, or an impossible value."""


class TrackError(PipelineError):
    """Arrays that do not make a track."""


class AnalysisError(PipelineError):
    """A track that a stage cannot work on; the message names the stage."""


class DynamicsError(PipelineError):
    """A motion that cannot be computed as asked: a coefficient, start, step, tolerance or method, or a blow-up."""
