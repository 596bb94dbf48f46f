"""Laws of damping: how the amplitude of a free oscillation decays with time.

:mod:`pipeline.damping.laws.law` defines the interface of a law. :mod:`pipeline.damping.laws.drag` contains the eight
laws of :math:`dA/dt = -(\\mu + \\gamma A + \\beta A^2)`, and :mod:`pipeline.damping.laws.power` contains the law
:math:`dA/dt = -c A^n`. A law is one small class and one entry in :data:`LAWS`, or an entry point of another package in
the group ``springmass.laws``; :func:`springmass.testing.check` tests it. :mod:`pipeline.damping.laws.of_function` makes
a law from a function.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from failure.extensions import load_named
from pipeline.bench.law_names import GROUP, law_names
from pipeline.damping.laws.drag import DRAGS, Drag
from pipeline.damping.laws.law import Law, free_power, in_units, units_of, words_of
from pipeline.damping.laws.of_function import FunctionLaw
from pipeline.damping.laws.power import Power
from pipeline.errors import AnalysisError

__all__ = ["LAWS", "Drag", "FunctionLaw", "Law", "find_law", "free_power", "in_units", "units_of", "words_of"]

_ALL: tuple[Law, ...] = (*DRAGS, Power())
LAWS: Mapping[str, Law] = MappingProxyType({law.name: law for law in _ALL})
"""The built-in damping laws by name, in the order in which they are tried."""


def find_law(law: str | Law) -> Law:
    """Return the law with a name, which another package may add; a law is returned unchanged."""
    if not isinstance(law, str):
        if LAWS.get(law.name, law) is not law:
            raise AnalysisError(f"a law of yours needs a new name, got {law.name!r}, which is taken")
        return law
    if law in LAWS:
        return LAWS[law]
    if law not in law_names():
        raise AnalysisError(f"laws must be of {', '.join(law_names())}, or laws of your own; got {law!r}")
    found: Law = load_named(GROUP, law, Law, AnalysisError)
    return found
