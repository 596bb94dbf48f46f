"""The names in the results: effects, estimates, inputs of the budgets and damping laws.

A result with a name that is not registered here raises an error, so the tables of a report always have its label. The
names of findings are in ``pipeline/findings/findings.toml``.
"""
