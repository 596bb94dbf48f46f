"""Stages from a track to findings: only arithmetic, no input or output.

The packages are listed in the order of the data flow; each imports only from those above it::

    track, units, notice, errors   one run as arrays; nouns and units; what a stage reports; the errors it raises
    numerics/       least squares, regression, estimates; independent of springs
    bench/          scene, air and clock: what is known before the analysis
    samples/        which samples a fit may use
    windows/        amplitude, phase and rest position once per period
    parts/          which part of the recording swings freely
    modes/          other oscillations beside the main one
    damping/        the laws by which the amplitudes decay
    dynamics/       the equation of motion and the integrator of the analysis
    motion/         the kind of motion, and the fit for that kind
    checks/         tests of the record against its own model
    results/        estimates with their budgets, effects, curves
    findings/       what is reported about a run, in words
    analyse         runs all stages in order; options has its accuracies

Two rooms beside this path start from its results: several/ compares runs, and simulation/ computes motions with any
integrator.
"""
