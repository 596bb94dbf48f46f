"""Drag derived from disc, bob and air, where a scene states no damping: the literature's coefficients, with theirs.

Three parts, none of which the scene states: vortices shed by the disc's edge, friction of the air in the Stokes layer
of the disc, and that of the bob. What the suspension and the spring take is nobody's to derive and is not in it.

References
----------
.. [1] J. M. R. Graham, "The forces on sharp-edged cylinders in oscillatory flow at low Keulegan-Carpenter numbers",
   J. Fluid Mech. 97 (1980) 331: measured coefficients of a flat plate follow 8.0 KC^(-1/3).
.. [2] P. de Bernardinis, J. M. R. Graham, K. H. Parker, "Oscillatory flow around disks and through orifices",
   J. Fluid Mech. 102 (1981) 279: the same of each piece of a disc's edge.
.. [3] H. Lamb, "Hydrodynamics", 6th ed., Cambridge 1932, art. 71 and 108: the flow about plate and disc at their edges.
.. [4] L. D. Landau, E. M. Lifshitz, "Fluid Mechanics", 2nd ed., Pergamon 1987, paragraph 24: a sphere that oscillates.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.bench.added_mass import added_mass_kg, scene_air, scene_air_density
from pipeline.bench.air import air_viscosity
from pipeline.bench.scene import Scene
from pipeline.bench.spring import oscillating_mass_kg
from pipeline.errors import SceneError
from pipeline.numerics.estimate import Joint
from pipeline.track import F8

__all__ = ["BOB_KG_PER_M3", "STEADY_DISC_DRAG", "DerivedDrag", "derive_drag", "disc_drag_coefficient", "needs_drag"]

STEADY_DISC_DRAG = 1.17  # drag coefficient of a disc broadside on in steady flow, Re > 1000
PLATE_DRAG = 8.0  # of a plate at KC = 1 [1]_
EDGE = 2.0 / math.pi  # velocity at a disc's edge over that at a plate's of the same width [3]_
SHED_POWER = 8.0 / 3.0  # of the edge's velocity: the force of what it sheds [1]_
EDGES = 2.0  # a disc's length of edge over its area, relative to a plate's
U_SHED = 0.2  # relative: measured plates about the law, and its transfer to a disc
U_VISCOUS = 0.5  # relative: the bob's shape and density are not stated, the disc's layer ends at its edge
BOB_KG_PER_M3 = 7850.0  # steel: of a bob whose size nobody stated
DOWN_TO = 1e-3  # of the start: the least amplitude at which the disc's law is matched


@dataclass(frozen=True, slots=True)
class DerivedDrag:
    """Coefficients of dA/dt = -(gamma A + beta A^2) that disc, bob and air imply.

    Parameters
    ----------
    gamma_per_s, beta_per_m_s : float
        1/s, 1/(m s).
    covariance : (2, 2) float64
        Of both in this order: the literature's.
    shed_per_s, layer_per_s, bob_per_s : float
        Rates of the logarithm of the amplitude at the start: edge vortices, the disc's Stokes layer, the bob's, 1/s.
    reynolds, keulegan_carpenter, coefficient : float
        Of the disc at the start; 0 without one.
    mismatch : float
        Largest difference of the two coefficients' rate from the law that they stand for, over it, down to the
        amplitude that is expected at the end.
    """

    gamma_per_s: float
    beta_per_m_s: float
    covariance: F8
    shed_per_s: float
    layer_per_s: float
    bob_per_s: float
    reynolds: float
    keulegan_carpenter: float
    coefficient: float
    mismatch: float

    @property
    def joint(self) -> Joint:
        """Both coefficients with their covariance, by the scene's attributes."""
        values = np.array([self.gamma_per_s, self.beta_per_m_s])
        return Joint(("gamma_per_s", "beta_per_m_s"), values, self.covariance, ("1/s", "1/(m s)"))

    @property
    def words(self) -> str:
        """Where they come from, in one line."""
        bob = f"a steel bob's air friction {self.bob_per_s:.2g} 1/s"
        if not self.coefficient:
            return f"{bob} (u 50 %; Landau and Lifshitz, par. 24)"
        return (
            f"disc at Re {self.reynolds:.3g}, KC {self.keulegan_carpenter:.3g}: C = {self.coefficient:.3g}, "
            f"{self.shed_per_s:.2g} 1/s at the start (u 20 %; Graham 1980, de Bernardinis et al. 1981), its Stokes "
            f"layer {self.layer_per_s:.2g} 1/s, {bob} (u 50 %)"
        )


def needs_drag(scene: Scene) -> bool:
    """Whether a scene names what the bob moves in or with, and no damping at all."""
    silent = scene.gamma_per_s is None and scene.beta_per_m_s is None and scene.mu_m_per_s is None
    air = (scene.air_temperature_c, scene.air_pressure_pa, scene.air_relative_humidity)
    return silent and (scene.disc_diameter_m is not None or any(each is not None for each in air))


def disc_drag_coefficient(keulegan_carpenter: float) -> float:
    """Return the drag coefficient of a thin disc that oscillates broadside on, of its area and largest speed.

    Notes
    -----
    A sharp edge sheds the same vortices whatever it belongs to, and their force goes as the velocity at the edge to
    the power 8/3 [1]_. At a disc's edge that is :math:`2/\\pi` of a plate's [3]_, of which a disc has twice as much for
    its area: :math:`8.0\\,(2/\\pi)^{8/3}\\,2\\,KC^{-1/3} = 4.8\\,KC^{-1/3}`, until at KC near 70 it meets the steady
    1.17.

    Examples
    --------
    >>> round(disc_drag_coefficient(3.0), 2)
    3.33
    """
    if keulegan_carpenter <= 0.0:
        return math.inf
    shed = PLATE_DRAG * math.pow(EDGE, SHED_POWER) * EDGES * math.pow(keulegan_carpenter, -1.0 / 3.0)
    return max(shed, STEADY_DISC_DRAG)


def derive_drag(scene: Scene, amplitude_m: float, seconds: float) -> DerivedDrag:
    """Return what disc, bob and air take from a motion.

    Parameters
    ----------
    scene : Scene
        Bob mass and spring constant are needed.
    amplitude_m : float
        With which it starts, m.
    seconds : float
        How long it goes, s: over the amplitudes of this time the coefficients match the disc's law.

    Raises
    ------
    SceneError
        If bob mass or spring constant is not stated.

    Notes
    -----
    The disc's C falls as the amplitude to the power -1/3, so that dA/dt = -c A^(5/3). Least squares over the logarithm
    of the amplitude, from the start to the end, make gamma + beta A of c A^(2/3). The Stokes layer takes
    :math:`\\gamma = (4/\\pi)\\,(\\eta/\\delta)\\,a^2\\,(\\ln(2a/\\delta) - 1)/M` with
    :math:`\\delta = \\sqrt{2\\nu/\\omega}`, from the potential flow along the disc, cut off a layer before the edge;
    the bob, a sphere of steel of its mass, :math:`3\\pi\\eta R(1 + R/\\delta)/M` [4]_.
    """
    if scene.bob_mass_kg is None or scene.spring_constant_n_per_m is None:
        raise SceneError("scene: drag is derived for a [bob] mass_kg on a [spring] constant_n_per_m; add both")
    celsius, pascal, _ = scene_air(scene)
    rho, eta = scene_air_density(scene), air_viscosity(celsius.value, pascal.value)
    bob = scene.bob_mass_kg.value
    spring = 0.0 if scene.spring_mass_kg is None else scene.spring_mass_kg.value
    mass = oscillating_mass_kg(spring, bob + added_mass_kg(scene))
    omega = math.sqrt(scene.spring_constant_n_per_m.value / mass)
    layer_m = math.sqrt(2.0 * eta / (rho * omega))
    radius = (3.0 * bob / (4.0 * math.pi * BOB_KG_PER_M3)) ** (1.0 / 3.0)
    of_bob = 3.0 * math.pi * eta * radius * (1.0 + radius / layer_m) / mass
    if scene.disc_diameter_m is None:
        covariance = np.diag([(U_VISCOUS * of_bob) ** 2, 0.0])
        return DerivedDrag(of_bob, 0.0, covariance, 0.0, 0.0, of_bob, 0.0, 0.0, 0.0, 0.0)
    a = 0.5 * scene.disc_diameter_m.value
    inside = max(math.log(2.0 * a / layer_m) - 1.0, 0.0) if layer_m < a else 0.0
    # Where the layer is thicker than the disc, its creeping drag 16 eta a v.
    of_layer = (4.0 / math.pi * eta / layer_m * a * a * inside + (8.0 * eta * a if not inside else 0.0)) / mass

    def shed(amplitude: float) -> float:
        number = math.pi * amplitude / a
        drag_per_m = 0.5 * rho * disc_drag_coefficient(number) * math.pi * a * a / mass
        return 4.0 * drag_per_m * omega * amplitude / (3.0 * math.pi)

    first = shed(amplitude_m) if amplitude_m > 0.0 else 0.0
    gamma, beta, mismatch = _matched(shed, amplitude_m, first, of_layer + of_bob, seconds)
    viscous = U_VISCOUS * (of_layer + of_bob)
    shares = U_SHED * np.array([gamma, beta])
    covariance = np.outer(shares, shares) + np.diag([viscous**2, 0.0])
    number = math.pi * amplitude_m / a
    coefficient = disc_drag_coefficient(number) if amplitude_m > 0.0 else 0.0
    reynolds = rho * omega * amplitude_m * 2.0 * a / eta
    return DerivedDrag(
        gamma + of_layer + of_bob,
        beta,
        covariance,
        first,
        of_layer,
        of_bob,
        reynolds,
        number,
        coefficient,
        mismatch,
    )


def _matched(
    shed: Callable[[float], float], start: float, first: float, viscous: float, seconds: float
) -> tuple[float, float, float]:
    """Return gamma and beta that match a rate over the amplitudes of a run, and their largest relative mismatch."""
    if first <= 0.0:
        return 0.0, 0.0, 0.0
    # dA/dt = -c A^(5/3) - g A ends at (1 + (1 - e^(-2 g t / 3)) c A0^(2/3) / g)^(-3/2) e^(-g t) of the start.
    rise = -math.expm1(-2.0 / 3.0 * viscous * seconds) * first / viscous if viscous > 0.0 else first * seconds / 1.5
    left = max((1.0 + rise) ** -1.5 * math.exp(-min(viscous * seconds, 50.0)), DOWN_TO)
    amplitudes = start * np.geomspace(min(left, 0.9), 1.0, 40)
    rates = np.array([shed(each) for each in amplitudes])
    columns = np.stack([np.ones_like(amplitudes), amplitudes / start], axis=1) / rates[:, None]
    (gamma, beta), *_ = np.linalg.lstsq(columns, np.ones(rates.size), rcond=None)
    beta /= start
    mismatch = float(np.max(np.abs((gamma + beta * amplitudes) / rates - 1.0)))
    return max(float(gamma), 0.0), max(float(beta), 0.0), mismatch
