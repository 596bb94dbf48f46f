"""Decoders: one file per family of rangefinders, and shared modules that cut streams into frames.

The input is the bytes of one read of a port; the boundaries of reads do not matter. The output is readings and counts
of faults. To add a family, copy ``example.py`` and add a line to ``registry.py``. The modules ``lines``,
``sum_frames``, ``replies``, ``cycle``, ``columns`` and ``framed`` are shared, so changes to them may affect several
families.
"""
