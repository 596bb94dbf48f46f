"""Drag derived from disc, bob and air where a scene states no damping, with uncertainties from the literature.

There are three parts: vortices shed by the disc's edge, friction of the air in the Stokes layer of the disc, and
friction of the air at the bob. Losses in the suspension and the spring cannot be derived and are not included.

References
----------
.. [1] J. M. R. Graham, "The forces on sharp-edged cylinders in oscillatory flow at low Keulegan-Carpenter numbers",
   J. Fluid Mech. 97 (1980) 331: measured coefficients of a flat plate follow 8.0 KC^(-1/3).
.. [2] P. de Bernardinis, J. M. R. Graham, K. H. Parker, "Oscillatory flow around disks and through orifices",
   J. Fluid Mech. 102 (1981) 279: the same law for each piece of a disc's edge.
.. [3] H. Lamb, "Hydrodynamics", 6th ed., Cambridge 1932, art. 71 and 108: the flow at the edges of plate and disc.
.. [4] L. D. Landau, E. M. Lifshitz, "Fluid Mechanics", 2nd ed., Pergamon 1987, paragraph 24: an oscillating sphere.
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
PLATE_DRAG = 8.0  # drag coefficient of a plate at KC = 1 [1]_
EDGE = 2.0 / math.pi  # velocity at a disc's edge over that at the edge of a plate of the same width [3]_
SHED_POWER = 8.0 / 3.0  # exponent of the velocity at the edge in the force of the shed vortices [1]_
EDGES = 2.0  # length of a disc's edge per area, relative to a plate's
U_SHED = 0.2  # relative uncertainty: scatter of measured plates about the law, and its transfer to a disc
U_VISCOUS = 0.5  # relative uncertainty: bob of unstated shape and density, disc's layer ending at the edge
BOB_KG_PER_M3 = 7850.0  # density of steel, assumed for a bob of unstated size
DOWN_TO = 1e-3  # smallest amplitude at which the disc's law is matched, over the initial one


@dataclass(frozen=True, slots=True)
class DerivedDrag:
    """Coefficients of dA/dt = -(gamma A + beta A^2) derived from disc, bob and air.

    Parameters
    ----------
    gamma_per_s, beta_per_m_s : float
        Coefficients, 1/s and 1/(m s).
    covariance : (2, 2) float64
        Covariance of gamma and beta, from the uncertainties in the literature.
    shed_per_s, layer_per_s, bob_per_s : float
        Decay rates of the logarithm of the amplitude at the start, 1/s: edge vortices, disc's Stokes layer, bob.
    reynolds, keulegan_carpenter, coefficient : float
        Reynolds number, Keulegan-Carpenter number and drag coefficient of the disc at the start; 0 without a disc.
    mismatch : float
        Maximum relative difference between the rate by the two coefficients and the disc's law, down to the expected
        final amplitude.
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
        """Both coefficients with their covariance, named as the scene's attributes."""
        values = np.array([self.gamma_per_s, self.beta_per_m_s])
        return Joint(("gamma_per_s", "beta_per_m_s"), values, self.covariance, ("1/s", "1/(m s)"))

    @property
    def words(self) -> str:
        """Origin of the coefficients, in one line."""
        bob = f"a steel bob's air friction {self.bob_per_s:.2g} 1/s"
        if not self.coefficient:
            return f"{bob} (u 50 %; Landau and Lifshitz, par. 24)"
        return (
            f"disc at Re {self.reynolds:.3g}, KC {self.keulegan_carpenter:.3g}: C = {self.coefficient:.3g}, "
            f"{self.shed_per_s:.2g} 1/s at the start (u 20 %; Graham 1980, de Bernardinis et al. 1981), its Stokes "
            f"layer {self.layer_per_s:.2g} 1/s, {bob} (u 50 %)"
        )


def needs_drag(scene: Scene) -> bool:
    """Return whether a scene states the air or the disc but no damping at all."""
    silent = scene.gamma_per_s is None and scene.beta_per_m_s is None and scene.mu_m_per_s is None
    air = (scene.air_temperature_c, scene.air_pressure_pa, scene.air_relative_humidity)
    return silent and (scene.disc_diameter_m is not None or any(each is not None for each in air))


def disc_drag_coefficient(keulegan_carpenter: float) -> float:
    """Return the drag coefficient of a thin disc oscillating broadside on, for its area and maximum speed.

    Notes
    -----
    The vortices of a sharp edge do not depend on the body, and their force is proportional to the velocity at the edge
    to the power 8/3 [1]_. The velocity at a disc's edge is :math:`2/\\pi` of that at a plate's [3]_. A disc has
    twice as much edge per area. So the coefficient is :math:`8.0\\,(2/\\pi)^{8/3}\\,2\\,KC^{-1/3} = 4.8\\,KC^{-1/3}`,
    until it reaches the steady value 1.17 at KC near 70.

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
    """Return the damping of a motion by disc, bob and air.

    Parameters
    ----------
    scene : Scene
        Scene with at least the bob's mass and the spring constant.
    amplitude_m : float
        Initial amplitude, m.
    seconds : float
        Duration of the motion, s; the coefficients match the disc's law over the amplitudes within this time.

    Raises
    ------
    SceneError
        If the bob's mass or the spring constant is not stated.

    Notes
    -----
    The disc's drag coefficient is proportional to the amplitude to the power -1/3, so that dA/dt = -c A^(5/3). Least
    squares over the logarithm of the amplitude, from the start to the end, approximate c A^(2/3) by gamma + beta A. The
    Stokes layer contributes :math:`\\gamma = (4/\\pi)\\,(\\eta/\\delta)\\,a^2\\,(\\ln(2a/\\delta) - 1)/M` with
    :math:`\\delta = \\sqrt{2\\nu/\\omega}`, from the potential flow along the disc, cut off at a distance
    :math:`\\delta` from the edge. The bob, as a steel sphere of its mass, contributes
    :math:`3\\pi\\eta R(1 + R/\\delta)/M` [4]_.
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
    # Where the layer is thick relative to the disc's radius, the drag is that of creeping flow, 16 eta a v.
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
    """Return gamma and beta matched to a rate over the amplitudes of a run, and the maximum relative mismatch."""
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
