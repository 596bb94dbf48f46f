"""What accuracy costs: estimators against each other on simulated records, or on one of the user's own.

In: a truth to simulate (or a track), and methods. Out: errors over the bound and times, as a table, JSON and a
figure. Free to change: kinds of hostile records (`truth.HOSTILE`) and reference methods (`methods.methods`), one
entry each; the generator shares no code with any estimator.
"""
