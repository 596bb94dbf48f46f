"""Simulations: the motion of a scene solved, compared with a measured run, and written as run files.

In: a scene and options. Out: a trajectory with its errors, effects and uncertainty band. To add an effect, add one row
to ``pipeline.results.effects.simulated_effects``.
"""
