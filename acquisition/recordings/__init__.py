"""Old recordings: which family a file is of, what it holds, and its samples with everything that was seen on the way.

In: the path of a file of any program. Out: a :class:`~acquisition.recordings.recording.Recording`; nothing is dropped.
A newcomer adds a file to ``families/`` and a line to ``identify``; ``tables/`` and ``sampling/`` serve every family.
"""
