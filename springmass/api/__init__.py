"""What ``import springmass`` offers to scripts and notebooks.

In: paths, open runs, datasets, frames and arrays, with scenes and options. Out: analyses that calculate, show
themselves, draw into anybody's axes and become frames and datasets. Free to change: how it is done; names and meanings
of what :mod:`springmass` exports stay.
"""
