"""Motion: from amplitudes, phases and laws to the motion itself, by the fit for its kind.

In: a conditioned record, its windows and laws. Out: frequency and phase, rest position, waveform, smoothed motion; or a
solution of the equation of motion where damping is strong, or rates where it ends the motion (``overdamped``).
A newcomer may add a kind of motion: its fit here, a branch in ``kinds`` and one in ``pipeline.analyse``.
"""
