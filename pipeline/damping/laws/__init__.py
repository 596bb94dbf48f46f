"""Laws of damping: how the amplitude of a free oscillation decays with time.

:mod:`pipeline.damping.laws.law` defines the interface of a law. :mod:`pipeline.damping.laws.drag` contains the eight
laws of :math:`dA/dt = -(\\mu + \\gamma A + \\beta A^2)`, and :mod:`pipeline.damping.laws.power` contains the law
:math:`dA/dt = -c A^n`. A law is one small class and one entry in :data:`LAWS`; ``tests/conformance/test_laws.py`` tests
its differential equation, its derivatives and its guess. :mod:`pipeline.damping.laws.of_function` makes a law from a
function.
"""

from __future__ import annotations

from pipeline.damping.laws.drag import DRAGS, Drag
from pipeline.damping.laws.law import Law, free_power, in_units, units_of, words_of
from pipeline.damping.laws.of_function import FunctionLaw, make_law
from pipeline.damping.laws.power import Power
from pipeline.errors import AnalysisError
from pipeline.numerics.quantity import Unit

__all__ = [
    "LAWS",
    "Drag",
    "FunctionLaw",
    "Law",
    "Power",
    "Unit",
    "find_law",
    "free_power",
    "in_units",
    "make_law",
    "units_of",
    "words_of",
]

_ALL: tuple[Law, ...] = (*DRAGS, Power())
LAWS: dict[str, Law] = {law.name: law for law in _ALL}
"""The built-in damping laws by name, in the order in which they are tried."""


def find_law(law: str | Law) -> Law:
    """Return the law with a name; a law is returned unchanged."""
    name = law if isinstance(law, str) else law.name
    if isinstance(law, str):
        if name not in LAWS:
            raise AnalysisError(f"laws must be of {', '.join(LAWS)}, or laws of your own; got {name!r}")
        return LAWS[name]
    if LAWS.get(name, law) is not law:
        raise AnalysisError(f"a law of yours needs a new name, got {name!r}, which is taken")
    return law
