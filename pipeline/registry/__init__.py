"""Every name that a result can carry, each kind in one place: findings, effects, estimates, inputs of the budgets.

A producer that uses a name that is not listed here raises an error, so no table of a report can lack it.
"""
