"""The live side: ports are read, and what they send becomes samples.

In: bytes off serial and network ports, each read with the host's stamp. Out: those reads, as they came, to a sink; and
through a sensor's chain (decoder, timebase, calibration) its :class:`~acquisition.block.Block` of samples.
To change: how a port is opened or named (``serial_port``), how a sensor is calibrated (``calibration``). ``timebase``
and ``decoding`` also rebuild every recorded run from its log: what they give must stay the same bit for bit.
"""
