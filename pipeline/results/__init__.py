"""Results: from a fitted motion to numbers with uncertainties.

Input: the results of the earlier stages, and the scene. Output: estimates with budgets, effects, and curves. A new
estimate is added in ``quantities`` and ``formulas``, and a new effect in ``effects``. A new finding is added in
``pipeline.findings``, with its code in docs/reference/findings.md; codes never change meaning.
"""
