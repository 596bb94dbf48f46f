"""The names of the damping laws that ship: what a scene, an option or a table may state."""

from __future__ import annotations

__all__ = ["LAW_NAMES"]

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
"""In the order in which they are tried; :data:`pipeline.damping.laws.LAWS` holds the law of each."""
