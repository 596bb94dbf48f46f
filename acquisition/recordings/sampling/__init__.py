"""Turn printed columns into samples: times on their grid, flags, and remarks on what is easy to misread.

In: printed times and values, and rows that could not be read. Out: times, flags and traps; no value is changed.
``samples`` finds the traps, and ``nominal`` lists the usual rates.
"""
