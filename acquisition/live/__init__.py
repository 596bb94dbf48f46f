"""Read ports and turn their bytes into samples.

In: bytes from serial and network ports, each read with its host time. Out: these reads, unchanged, to a sink; and
through a sensor's chain (decoder, timebase, calibration) a :class:`~acquisition.block.Block` of samples.
``serial_port`` opens and names ports, ``calibration`` calibrates a sensor. ``timebase`` and ``decoding`` also rebuild
every recorded run from its log, so their results must stay the same bit for bit.
"""
