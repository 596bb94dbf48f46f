"""Findings: the statements about a run, in words."""
