"""The names of the damping laws, for scenes, options and tables."""

from __future__ import annotations

from failure.extensions import names_in

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
"""The built-in names in the order in which the laws are tried; :data:`pipeline.damping.laws.LAWS` contains the laws."""

ANY_LAW = "any"
"""The value in place of a law's name that lets the recording choose, regardless of the scene."""

GROUP = "springmass.laws"
"""The group of the entry points with which other packages add laws."""


def law_names() -> tuple[str, ...]:
    """Return the names of the built-in laws, then those of the laws that other packages add."""
    return names_in(GROUP, LAW_NAMES)
