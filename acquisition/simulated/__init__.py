"""The simulated rangefinder, as a source of blocks or behind a pseudo-terminal.

The inputs are the position of the bob as a function of time, the quality of the sensor, and the faults of its line. The
results are readings with the noise and false echoes of a real sensor. They are blocks, or bytes of a family, which the
real serial code reads. All random numbers come from the given generator, so every run is reproducible.
"""
