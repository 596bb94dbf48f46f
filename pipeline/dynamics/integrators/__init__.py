"""The integrators, one family a file.

In comes a problem with a step and a number of steps; out goes a trajectory, or an error that says why there is none.
A newcomer's file follows ``runge_kutta.py`` for a step that repeats, ``taylor.py`` for one of any other kind.
"""
