"""Spring: the part of its mass that oscillates, and the typical mass where the scene does not state it."""

from __future__ import annotations

import math

from pipeline.numerics.estimate import Estimate

# Maximum mass of an unweighed spring over the bob's, beyond which its probability is taken as zero: laboratory springs
# have 5 to 50 g for bobs of 0.1 to 0.5 kg.
HEAVIEST_SHARE = 0.3
GRAVITY_M_PER_S2 = 9.80665  # standard gravity, by definition, 3rd CGPM (1901)
# Ratio of spring mass to load up to which the series of Fox and Mahanty (1970) is exact to 1e-13.
SERIES = 1e-4


def oscillating_mass_kg(spring_kg: float, load_kg: float) -> float:
    """Return the mass M, kg, for which k = omega^2 M is valid for a load on a uniform spring.

    Waves along the spring give :math:`x \\tan x = m_s/m` with :math:`x = \\omega\\sqrt{m_s/k}`, whose smallest root
    gives :math:`k = \\omega^2 m_s/x^2`. For a light spring :math:`m_s/x^2 = m + m_s/3 + m_s^2/(45 m) - \\ldots`. With a
    third of the spring's mass, M is too small by the fraction 2.1e-4 for :math:`m_s/m = 0.1` and 42e-4 for 0.5.

    J. G. Fox, J. Mahanty, "The effective mass of an oscillating spring", Am. J. Phys. 38 (1970) 98,
    doi:10.1119/1.1976240.

    >>> round(oscillating_mass_kg(0.1, 1.0) / (1.0 + 0.1 / 3.0) - 1.0, 6)
    0.00021
    """
    ratio = spring_kg / load_kg
    if ratio < SERIES:
        return load_kg + spring_kg / 3.0 + spring_kg * ratio / 45.0
    from scipy.optimize import brentq

    x = float(brentq(lambda x: x - math.atan2(ratio, x), 0.0, math.pi / 2.0, xtol=1e-16, rtol=1e-15))
    return spring_kg / (x * x)


def unstated_spring_kg(bob_kg: float) -> Estimate:
    """Return the mass, kg, of a spring that was not weighed, for a mass of the bob: 0 with an uncertainty.

    The uncertainty is the root mean square of a rectangular distribution from 0 to 0.3 of the bob's mass. The mean is
    not corrected for, so it is included in the uncertainty (JCGM 100:2008, F.2.4.5).
    """
    return Estimate(0.0, HEAVIEST_SHARE * bob_kg / math.sqrt(3.0), "kg")
