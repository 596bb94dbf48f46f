"""The motion of a record that oscillates."""

from __future__ import annotations

from pipeline.analyse import Analysis, Oscillation


def motion_of(result: Analysis) -> Oscillation:
    """Return the motion of a record that has one."""
    assert isinstance(result.motion, Oscillation), result.motion
    return result.motion
