"""Results: from a fitted motion to numbers with uncertainties, and sentences about them.

Input: the results of the earlier stages, and the scene. Output: estimates with budgets, effects, curves and
comparisons. A new estimate is added in ``derive`` and a new effect in ``effects``. A new finding is added in
``pipeline.findings``, with its code in docs/reference/findings.md; codes never change meaning.
"""
