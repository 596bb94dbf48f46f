"""Simulations: what is made of a scene, how it is solved and checked, and how a measured run compares.

In come a scene and what was asked for; out go a trajectory with its errors, the effects, the band, and a run beneath a
prediction. A newcomer's effect is one row of ``pipeline.results.simulated_effects``.
"""
