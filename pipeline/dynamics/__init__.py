"""The equation of motion, what an integrator must do, and the integrator with which the analysis solves it."""
