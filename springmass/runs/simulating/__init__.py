"""Simulations: preparing a scene, solving and checking its motion, and comparing it with a measured run.

In: a scene and options. Out: a trajectory with its errors, the effects, the uncertainty band, and a comparison of a
measured run with the prediction. To add an effect, add one row to ``pipeline.results.simulated_effects``.
"""
