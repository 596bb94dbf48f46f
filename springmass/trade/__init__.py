"""What accuracy costs: ways to evaluate a record, and to solve a motion, by their error and their time.

In: a truth to simulate, or a track, and methods. Out: errors and times as tables, JSON and figures. Free to change:
kinds of hostile records (``truth.HOSTILE``) and reference methods (``methods.methods``), one entry each.
"""
