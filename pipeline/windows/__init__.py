"""Windows: the period, and amplitude, phase and rest position once per period.

The room contains the first estimate of the period from the spectrum, the demodulation in windows and the search for
second modes. It also finds the part of a recording in which the bob moves freely.
"""
