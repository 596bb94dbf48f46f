"""The names of the built-in damping laws, for scenes, options and tables."""

from __future__ import annotations

LAW_NAMES = (
    "none",
    "linear",
    "quadratic",
    "friction",
    "linear+quadratic",
    "linear+friction",
    "quadratic+friction",
    "linear+quadratic+friction",
    "power",
)
"""The names in the order in which the laws are tried; :data:`pipeline.damping.laws.LAWS` contains the laws."""
