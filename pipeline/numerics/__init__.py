"""Numerics: what any room may calculate with, knowing nothing of springs.

In: plain arrays. Out: least squares with a certified end, weighted regression, spectra, random walks, estimates.
A newcomer may add what several rooms need and no library gives, with the figure that says so in its first lines.
"""
