"""Compare runs of one spring with each other, with printed values, and with Hooke's law.

In: runs, and tables that a user wrote. Out: a ``SpringComparison`` and its JSON.
"""
