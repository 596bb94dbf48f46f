"""The interface that ``import springmass`` offers to scripts and notebooks.

In: paths, open runs, datasets, frames and arrays, with scenes and options. Out: analyses with estimates to calculate
with, summaries, plots into given axes, frames and datasets. Free to change: the implementation; the names that
:mod:`springmass` exports and their meanings are fixed.
"""
