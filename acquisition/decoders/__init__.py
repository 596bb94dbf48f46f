"""Decoders: one file per family of rangefinders, and shared modules that cut streams into frames.

In: the bytes of one read of a port, however the stream was cut. Out: readings, and counts of faults. To add a family,
copy ``example.py`` and add a line to ``registry.py``. ``lines``, ``sum_frames``, ``replies``, ``cycle``, ``columns``
and ``framed`` are shared, so a change to one of them affects several families.
"""
