"""Numerics: calculations that any room may use and that know nothing of springs.

In: plain arrays. Out: least squares with certified convergence, weighted regression, estimates, levels of tests.
A newcomer may add what several rooms need and no library provides; its first lines give the figure that shows this.
"""
