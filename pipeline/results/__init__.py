"""Results: from a fitted motion to numbers with uncertainties and sentences.

In: what the rooms before found, and the scene. Out: estimates with budgets, effects, findings, curves, comparisons.
A newcomer may add an estimate in ``derive``, an effect in ``effects``, a finding in ``findings`` with its code in
docs/reference/findings.md; codes never change meaning.
"""
