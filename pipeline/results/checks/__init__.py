"""Checks: a record is judged against itself before a number of it is believed.

In: the motion as the rooms before found it, with the samples behind it. Out: findings, and what a contradicted model
adds to the uncertainties. A newcomer may add a check in a module of its own, with the record that makes it fire and its
code in docs/reference/findings.md; thresholds are calibrated on false alarms of plain records.
"""
