"""Damping: from the windows' amplitudes to the laws by which they fall.

In: amplitudes with covariances against time. Out: every law's parameters, the selected one and those the record admits.
To add a law, write one class and one entry in ``laws``; only ``evidence`` decides which law is selected.
"""
