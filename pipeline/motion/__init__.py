"""Motion: from amplitudes, phases and damping laws to the motion itself, by the fit for its kind.

Input: samples, their windows and laws. Output: frequency and phase, rest position, waveform and smoothed motion. Strong
damping gives a solution of the equation of motion instead, and a motion without cycles gives relaxation rates
(``relaxation``). To add a kind of motion, add its fit here and a branch in ``pipeline.analyse``.
"""
