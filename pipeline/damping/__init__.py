"""Damping: from the windows' amplitudes to the laws by which they fall.

In: amplitudes with covariances against time. Out: every law's parameters, the selected one and those the record admits.
A newcomer may add a law, one class and one entry in ``laws``; ``evidence`` alone decides which law stands.
"""
