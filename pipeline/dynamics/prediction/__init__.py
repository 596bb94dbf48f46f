"""What is known of a run before it is made: its limit of stability, and its error by pilots.

In comes a problem with an integrator and a step; out goes the largest stable step, or an error over the amplitude. A
newcomer's way to predict is one more file here, and its figures stand in docs/explanation/integrators.md.
"""
