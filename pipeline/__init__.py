"""Stages from a track to findings: only arithmetic, no input or output.

The rooms in the order in which data flows; each imports only from those before it::

    track, errors   one run as arrays; what a stage refuses
    numerics/       least squares, regression, spectra, random walks, estimates: knows nothing of springs
    bench/          scene, air, instrument: what is known beforehand
    oscillation/    samples to amplitude, phase and rest position against time
    damping/        amplitudes to the laws by which they fall
    dynamics/       the equation of motion and its integrators
    motion/         which kind of motion it is, and the fit for that kind
    results/        checks/ of the record against itself before a number is believed; estimates, effects, findings
    analyse         the line through the rooms; accuracy: its presets; streaming: the same while samples still come
"""
