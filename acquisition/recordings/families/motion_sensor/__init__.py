"""MotionSensor.vi: ``layout`` finds the columns, ``column`` reads them, ``position_velocity`` reads a file or a pair.

In: the bytes of one or two texts. Out: a :class:`~acquisition.recordings.recording.Recording`. The words of titles
and column lines are in ``layout``. Faults of rows are handled by the shared code in ``tables`` and ``sampling``.
"""

from acquisition.recordings.families.motion_sensor.position_velocity import FORMAT

__all__ = ["FORMAT"]
