"""What is known of the bench.

In: a scene's tables, and the clock and scale of a track. Out: bob, spring, disc and air as estimates, the air's
density, viscosity and speed of sound, the mass of air carried along, and what the instrument adds to uncertainties.
A new quantity of the scene is one row of ``scene.py`` and one of docs/reference/scene.md; formulas name their source.
"""
