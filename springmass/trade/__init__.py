"""The cost of accuracy: error and time of methods that evaluate a record, and of methods that solve a motion.

In: methods, and either true values to simulate or a track. Out: errors and times as tables, JSON and figures. Free to
change: kinds of hostile records (``truth.HOSTILE``) and reference methods (``methods.references``), each of which is
one entry.
"""
