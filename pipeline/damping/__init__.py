"""Damping: from the windows' amplitudes to the laws by which they decay.

Input: amplitudes with covariances against time. Output: the parameters of every law, the selected law, and the laws
that the record admits. To add a law, write one class and one entry in ``laws``; ``law_fit`` tests it and ``select``
decides among the laws.
"""
