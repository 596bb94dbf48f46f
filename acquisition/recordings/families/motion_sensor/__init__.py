"""MotionSensor.vi: ``layout`` tells what stands where, ``column`` reads one file, ``position_velocity`` one or a pair.

In: the bytes of one such text, or of two. Out: a :class:`~acquisition.recordings.recording.Recording`. A newcomer may
add words of titles and column lines in ``layout``; what is wrong with rows is judged in the shared rooms, for all.
"""

from acquisition.recordings.families.motion_sensor.position_velocity import FORMAT

__all__ = ["FORMAT"]
