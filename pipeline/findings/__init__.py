"""Findings: what is reported about a run, in words."""
