"""Bench: the known quantities of the experiment and of its sensor.

In: a scene's tables, and the clock of a track. Out: bob, spring, disc and air as estimates, the air's density,
viscosity and speed of sound, the added mass of air, and the rate of the clock with its uncertainty.
A new quantity of the scene is one row in ``scene.py`` and one in docs/reference/scene.md; formulas cite their source.
"""
