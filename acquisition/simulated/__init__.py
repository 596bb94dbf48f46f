"""The simulated rangefinder, as a source of blocks or behind a pseudo-terminal.

In: the position of the bob as a function of time, the quality of the sensor, and the faults of its line. Out: readings
with the noise and false echoes of a real sensor, as blocks, or as bytes of a family that the real serial code reads.
All random numbers come from the given generator, so every run can be repeated.
"""
