"""Stages from a track to findings: only arithmetic, no input or output.

The packages are listed in the order of the data flow; each imports only from those above it::

    track, errors   one run as arrays; the errors that stages raise
    numerics/       least squares, regression, spectra, estimates; independent of springs
    registry/       the names of estimates, budget inputs, effects and laws
    bench/          scene, air and instrument: what is known before the analysis
    samples/        which samples a fit may use
    windows/        amplitude, phase and rest position once per period
    damping/        the laws by which the amplitudes decay
    dynamics/       the equation of motion and its integrators
    motion/         the kind of motion, and the fit for that kind
    checks/         tests of the record against its own model
    results/        estimates with their budgets, effects, curves, comparisons
    findings/       what is reported about a run, in words
    analyse         runs all stages in order; accuracy has its presets
"""
