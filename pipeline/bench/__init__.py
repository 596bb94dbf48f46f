"""Bench: the known quantities of the experiment and of its instrument.

In: a scene's tables, and the clock and scale of a track. Out: bob, spring, disc and air as estimates, the air's
density, viscosity and speed of sound, the added mass of air, and the instrument's contributions to uncertainties.
A new quantity of the scene is one row in ``scene.py`` and one in docs/reference/scene.md; formulas cite their source.
"""
