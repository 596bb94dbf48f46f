"""The simulated rangefinder, as a source of blocks or behind a pseudo-terminal.

In: where the bob is as a function of time, how good the sensor is, and what goes wrong on its line. Out: readings with
a real sensor's noise and false echoes, as blocks, or as bytes in a family's wire form that the real serial code reads.
To change: what a bad sensor or line does. All chance comes from the generator given, so every run can be repeated.
"""
