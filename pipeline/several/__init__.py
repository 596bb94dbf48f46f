"""Several runs: joint fits of a law, and comparisons of springs, masses and the benches of a course.

In: the motions and results of runs that were analysed one by one. Out: common values, and where the runs disagree.
"""
