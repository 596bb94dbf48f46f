"""Read ports and turn their bytes into samples.

The input is bytes from serial and network ports, with a host time for each read. The reads are passed unchanged to a
sink. The chain of a sensor (decoder, timebase, calibration) turns them into a :class:`~acquisition.block.Block` of
samples. ``serial_port`` lists and opens ports, and ``calibration`` calibrates a sensor. ``timebase`` and ``decoding``
also reconstruct every recorded run from its log, so future versions must give bit-identical results.
"""
