"""Load recordings: from files, run files, wire logs, arrays or standard input, with scene and notes.

In: a path or arrays, and the options of reading. Out: ``Loaded``, with the samples as recorded and the ``Track`` that
the pipeline analyses. Nothing is analysed or printed here. Free to change: how an input becomes a ``Track``.
"""
