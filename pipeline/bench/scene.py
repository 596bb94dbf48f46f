"""What is at the bench: bob, spring, disc, air, sensor, each with its uncertainty; the unknown is None."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from pipeline.errors import SceneError
from pipeline.numerics.estimate import Estimate

__all__ = ["Scene"]

POSITIONS = ("below", "above")

# (table, key) -> (attribute, unit, least allowed value, "exclusive" where the least is not itself allowed)
_QUANTITIES: dict[tuple[str, str], tuple[str, str, float, bool]] = {
    ("bob", "mass_kg"): ("bob_mass_kg", "kg", 0.0, True),
    ("spring", "mass_kg"): ("spring_mass_kg", "kg", 0.0, False),
    ("spring", "constant_n_per_m"): ("spring_constant_n_per_m", "N/m", 0.0, True),
    ("spring", "cubic_n_per_m3"): ("spring_cubic_n_per_m3", "N/m3", -math.inf, False),
    ("disc", "diameter_m"): ("disc_diameter_m", "m", 0.0, True),
    ("air", "temperature_c"): ("air_temperature_c", "degC", -273.15, True),
    ("air", "pressure_pa"): ("air_pressure_pa", "Pa", 0.0, True),
    ("air", "relative_humidity"): ("air_relative_humidity", "", 0.0, False),
    ("sensor", "sigma_m"): ("sensor_sigma_m", "m", 0.0, True),
    ("start", "displacement_m"): ("start_displacement_m", "m", -math.inf, False),
    ("start", "velocity_m_per_s"): ("start_velocity_m_per_s", "m/s", -math.inf, False),
    ("damping", "gamma_per_s"): ("gamma_per_s", "1/s", 0.0, False),
    ("damping", "beta_per_m_s"): ("beta_per_m_s", "1/(m s)", 0.0, False),
    ("damping", "mu_m_per_s"): ("mu_m_per_s", "m/s", 0.0, False),
}
_GREATEST = {("air", "relative_humidity"): 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The bench.

    Every quantity is an :class:`Estimate` or None where it is not known; a plain number in the scene file has
    ``u`` = 0. The attributes ``spring_constant_n_per_m``, ``spring_cubic_n_per_m3``, ``start_*`` and the damping
    coefficients are what a simulation needs; an analysis measures them instead.
    """

    bob_mass_kg: Estimate | None = None
    spring_mass_kg: Estimate | None = None
    spring_constant_n_per_m: Estimate | None = None
    spring_cubic_n_per_m3: Estimate | None = None
    disc_diameter_m: Estimate | None = None
    air_temperature_c: Estimate | None = None
    air_pressure_pa: Estimate | None = None
    air_relative_humidity: Estimate | None = None
    sensor_sigma_m: Estimate | None = None
    sensor_position: str | None = None
    start_displacement_m: Estimate | None = None
    start_velocity_m_per_s: Estimate | None = None
    gamma_per_s: Estimate | None = None
    beta_per_m_s: Estimate | None = None
    mu_m_per_s: Estimate | None = None

    @classmethod
    def from_mapping(cls, tables: Mapping[str, Any], *, where: str = "scene") -> Scene:
        """Check the tables of a scene file and make a scene of them.

        Parameters
        ----------
        tables : mapping
            As ``tomllib`` gives it: ``{"bob": {"mass_kg": {"value": 0.2, "u": 5e-5}}, ...}``.
        where : str
            Named in errors, usually the file.

        Raises
        ------
        SceneError
            For an unknown table or key, a value that is no number, one outside its range, or a negative
            uncertainty; the message names file, key, value and what is allowed.

        Examples
        --------
        >>> Scene.from_mapping({"bob": {"mass_kg": 0.2007}}).bob_mass_kg
        Estimate(value=0.2007, u=0.0, unit='kg')
        """
        known: dict[str, Any] = {}
        for table, content in tables.items():
            allowed = [key for name, key in _QUANTITIES if name == table]
            if table == "sensor":
                allowed.append("position")
            if not allowed:
                names = ", ".join(dict.fromkeys(name for name, _ in _QUANTITIES))
                raise SceneError(f"{where}: unknown table [{table}]; allowed are {names}")
            if not isinstance(content, Mapping):
                raise SceneError(f"{where}: {table} must be a table, got {content!r}; write [{table}] above its keys")
            for key, value in content.items():
                if key not in allowed:
                    raise SceneError(
                        f"{where}: unknown key {key!r} in [{table}] (value {value!r}); allowed are {', '.join(allowed)}"
                    )
                if (table, key) == ("sensor", "position"):
                    known["sensor_position"] = _position(value, where)
                else:
                    known[_QUANTITIES[table, key][0]] = _quantity(table, key, value, where)
        return cls(**known)

    def to_mapping(self) -> dict[str, dict[str, Any]]:
        """Return the tables again, unknown quantities left out; the inverse of :meth:`from_mapping`."""
        tables: dict[str, dict[str, Any]] = {}
        for (table, key), (attribute, *_) in _QUANTITIES.items():
            estimate: Estimate | None = getattr(self, attribute)
            if estimate is not None:
                plain = estimate.u == 0
                tables.setdefault(table, {})[key] = (
                    estimate.value if plain else {"value": estimate.value, "u": estimate.u}
                )
        if self.sensor_position is not None:
            tables.setdefault("sensor", {})["position"] = self.sensor_position
        return tables

    @property
    def is_empty(self) -> bool:
        """Whether nothing at all is known."""
        return all(getattr(self, f.name) is None for f in fields(self))


def _position(value: object, where: str) -> str:
    if value not in POSITIONS:
        raise SceneError(f"{where}: [sensor] position must be one of {', '.join(POSITIONS)}, got {value!r}")
    return str(value)


def _quantity(table: str, key: str, given: object, where: str) -> Estimate:
    _, unit, least, exclusive = _QUANTITIES[table, key]
    greatest = _GREATEST.get((table, key), math.inf)
    name = f"{where}: [{table}] {key}"
    value: object = given
    u: object = 0.0
    if isinstance(given, Mapping):
        unknown = sorted(set(given) - {"value", "u"})
        if unknown or "value" not in given:
            raise SceneError(f"{name} must be a number or {{ value = ..., u = ... }}, got {dict(given)!r}")
        value, u = given["value"], given.get("u", 0.0)
    number, spread = _number(value, name), _number(u, f"{name}, its u")
    below: Callable[[float], bool] = (lambda x: x <= least) if exclusive else (lambda x: x < least)
    if below(number) or number > greatest:
        bound = f"{'more than' if exclusive else 'at least'} {least:g} {unit}".rstrip()
        upper = "" if math.isinf(greatest) else f" and at most {greatest:g}"
        raise SceneError(f"{name} must be {bound}{upper}, got {number:g}")
    if spread < 0:
        raise SceneError(f"{name}: its u must not be negative, got {spread:g}")
    return Estimate(number, spread, unit)


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SceneError(f"{name} must be a finite number, got {value!r}")
    return float(value)
