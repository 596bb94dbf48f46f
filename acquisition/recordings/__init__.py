"""Recordings of other programs: identify the format of a file, list its content, and read its samples.

In: the path of a file of any program. Out: a :class:`~acquisition.recordings.recording.Recording`; nothing is dropped.
To add a format, add a file to ``families/`` and a line to ``identify``. All families use ``tables/`` and ``sampling/``.
"""
