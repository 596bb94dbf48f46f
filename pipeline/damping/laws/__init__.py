"""Laws of damping: how the amplitude of a free oscillation falls with time.

:mod:`pipeline.damping.laws.law` says what a law offers, :mod:`pipeline.damping.laws.drag` holds the eight laws of
:math:`dA/dt = -(\\mu + \\gamma A + \\beta A^2)`, :mod:`pipeline.damping.laws.power` that of :math:`-c A^n`. A law is
one
small class and one entry of :data:`LAWS`; ``tests/conformance/test_laws.py`` holds each to its differential equation,
to its Jacobian and to its guess.
"""

from __future__ import annotations

from pipeline.damping.laws.drag import DRAGS, Drag
from pipeline.damping.laws.law import Law
from pipeline.damping.laws.power import Power

__all__ = ["LAWS", "Drag", "Law", "Power"]

_ALL: tuple[Law, ...] = (*DRAGS, Power())
LAWS: dict[str, Law] = {law.name: law for law in _ALL}
