"""Windows: the period, and amplitude, phase and rest position once per period.

The room holds the spectrum's first period, the demodulation in windows, second modes, and the search for the part of a
recording in which the bob moves freely.
"""
