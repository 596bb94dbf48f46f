"""Stages from a track to findings: arithmetic alone, no input or output."""
