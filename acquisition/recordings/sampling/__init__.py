"""From columns as printed to samples: times on their grid, flags, and what a careless reader would have got wrong.

In: printed times and values, and rows that could not be read. Out: times, flags and traps, no value changed.
A newcomer may add a trap in ``samples`` or a usual rate in ``nominal``.
"""
