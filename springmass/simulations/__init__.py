"""Simulations: solving the motion of a scene, laying it over a measured run, and writing both.

In: a scene and options. Out: a trajectory with its errors, effects and uncertainty band. To add an effect, add one row
to ``pipeline.results.effects.simulated_effects``.
"""
