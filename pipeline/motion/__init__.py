"""Motion: from amplitudes, phases and damping laws to the motion itself, by the fit for its kind.

Input: a conditioned record, its windows and laws. Output: frequency and phase, rest position, waveform and smoothed
motion. Strong damping gives a solution of the equation of motion instead, and overdamping gives relaxation rates
(``overdamped``). To add a kind of motion, add its fit here, a branch in ``kinds`` and one in ``pipeline.analyse``.
"""
