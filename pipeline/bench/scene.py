"""Scene: bob, spring, disc, air and sensor at the bench, with uncertainties; unknown quantities are None."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from pipeline.bench.air import saturation_pressure
from pipeline.bench.law_names import law_names
from pipeline.bench.typed import typed
from pipeline.errors import SceneError
from pipeline.numerics.estimate import Estimate

Stated: TypeAlias = Estimate | float | str | tuple[float, float] | None
"""What a scene takes for a quantity: a number, a pair (value, u), or a text with its unit, besides an estimate."""
POSITIONS = ("below", "above")
_CHOICES: dict[tuple[str, str], tuple[str, Callable[[], tuple[str, ...]]]] = {
    ("sensor", "position"): ("sensor_position", lambda: POSITIONS),
    ("damping", "law"): ("damping_law", law_names),
}
"""Keys of a scene file with text values: the attribute for each key, and what returns the allowed texts."""


class BenchKey(NamedTuple):
    """One key of a scene file: its attribute, its unit, and its allowed range, including both ends.

    The ends lie far beyond any bench. The calculations are known to be valid between them, so every allowed value gives
    a number or a finding. A value with a wrong exponent is rejected when it is read.
    """

    attribute: str
    unit: str
    least: float
    greatest: float

    def allowed(self) -> str:
        """Return the range in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.least > 0.0:
            return f"more than 0{unit}, from {self.least:g} to {self.greatest:g}"
        return f"at least {self.least:g}{unit} and at most {self.greatest:g}"


BENCH_KEYS: dict[tuple[str, str], BenchKey] = {
    ("bob", "mass_kg"): BenchKey("bob_mass_kg", "kg", 1e-12, 1e6),
    ("spring", "mass_kg"): BenchKey("spring_mass_kg", "kg", 0.0, 1e6),
    ("spring", "constant_n_per_m"): BenchKey("spring_constant_n_per_m", "N/m", 1e-12, 1e12),
    ("spring", "cubic_n_per_m3"): BenchKey("spring_cubic_n_per_m3", "N/m3", -1e18, 1e18),
    ("pendulum", "length_m"): BenchKey("pendulum_length_m", "m", 1e-4, 1e4),
    ("disc", "diameter_m"): BenchKey("disc_diameter_m", "m", 1e-6, 1e3),
    ("air", "temperature_c"): BenchKey("air_temperature_c", "degC", -100.0, 200.0),
    ("air", "pressure_pa"): BenchKey("air_pressure_pa", "Pa", 1e-3, 1e7),
    ("air", "relative_humidity"): BenchKey("air_relative_humidity", "", 0.0, 1.0),
    ("sensor", "sigma_m"): BenchKey("sensor_sigma_m", "m", 1e-12, 1e3),
    ("sensor", "mean_samples"): BenchKey("sensor_mean_samples", "", 1.0, 1e4),
    ("sensor", "lag_s"): BenchKey("sensor_lag_s", "s", 0.0, 1e3),
    ("sensor", "clock_ppm"): BenchKey("sensor_clock_ppm", "ppm", -1e5, 1e5),
    ("start", "displacement_m"): BenchKey("start_displacement_m", "m", -1e3, 1e3),
    ("start", "velocity_m_per_s"): BenchKey("start_velocity_m_per_s", "m/s", -1e6, 1e6),
    ("damping", "gamma_per_s"): BenchKey("gamma_per_s", "1/s", 0.0, 1e6),
    ("damping", "beta_per_m_s"): BenchKey("beta_per_m_s", "1/(m s)", 0.0, 1e6),
    ("damping", "mu_m_per_s"): BenchKey("mu_m_per_s", "m/s", 0.0, 1e6),
}

PLACES = {quantity.attribute: place for place, quantity in BENCH_KEYS.items()}
"""Table and key in a scene file for every quantity, by its attribute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The quantities of the bench.

    Every quantity is an :class:`Estimate`, or None if it is unknown; a plain number in the scene file has ``u`` = 0.
    The attributes ``spring_constant_n_per_m``, ``spring_cubic_n_per_m3``, ``start_*`` and the damping coefficients are
    inputs of a simulation; an analysis measures them instead. ``damping_law`` is the name of the damping law if it is
    known; an analysis states its results by this law.
    """

    bob_mass_kg: Estimate | None = None
    spring_mass_kg: Estimate | None = None
    spring_constant_n_per_m: Estimate | None = None
    spring_cubic_n_per_m3: Estimate | None = None
    pendulum_length_m: Estimate | None = None
    disc_diameter_m: Estimate | None = None
    air_temperature_c: Estimate | None = None
    air_pressure_pa: Estimate | None = None
    air_relative_humidity: Estimate | None = None
    sensor_sigma_m: Estimate | None = None
    sensor_position: str | None = None
    sensor_mean_samples: Estimate | None = None
    sensor_lag_s: Estimate | None = None
    sensor_clock_ppm: Estimate | None = None
    start_displacement_m: Estimate | None = None
    start_velocity_m_per_s: Estimate | None = None
    gamma_per_s: Estimate | None = None
    beta_per_m_s: Estimate | None = None
    mu_m_per_s: Estimate | None = None
    damping_law: str | None = None

    if TYPE_CHECKING:  # a number or a pair becomes an estimate, which a checker cannot know

        def __init__(
            self,
            *,
            bob_mass_kg: Stated = None,
            spring_mass_kg: Stated = None,
            spring_constant_n_per_m: Stated = None,
            spring_cubic_n_per_m3: Stated = None,
            pendulum_length_m: Stated = None,
            disc_diameter_m: Stated = None,
            air_temperature_c: Stated = None,
            air_pressure_pa: Stated = None,
            air_relative_humidity: Stated = None,
            sensor_sigma_m: Stated = None,
            sensor_position: str | None = None,
            sensor_mean_samples: Stated = None,
            sensor_lag_s: Stated = None,
            sensor_clock_ppm: Stated = None,
            start_displacement_m: Stated = None,
            start_velocity_m_per_s: Stated = None,
            gamma_per_s: Stated = None,
            beta_per_m_s: Stated = None,
            mu_m_per_s: Stated = None,
            damping_law: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check every value, and take a number or a pair (value, u) for the estimate that it states."""
        for (table, key), quantity in BENCH_KEYS.items():
            if (given := getattr(self, quantity.attribute)) is not None:
                found = _quantity(table, key, given, "scene")
                if not isinstance(given, Estimate):
                    object.__setattr__(self, quantity.attribute, found)
        for (table, key), (attribute, texts) in _CHOICES.items():
            if (text := getattr(self, attribute)) is not None:
                _choice(table, key, text, texts(), "scene")

    @classmethod
    def from_mapping(cls, tables: Mapping[str, Any], *, where: str = "scene") -> Scene:
        """Check the tables of a scene file and convert them to a scene.

        >>> Scene.from_mapping({"bob": {"mass_kg": 0.2007}}).bob_mass_kg
        0.2007 kg
        """
        known: dict[str, Any] = {}
        for table, content in tables.items():
            allowed = [key for name, key in (*BENCH_KEYS, *_CHOICES) if name == table]
            if not allowed:
                names = ", ".join(dict.fromkeys(name for name, _ in BENCH_KEYS))
                raise SceneError(f"{where}: unknown table [{_short(table)[1:-1]}]", f"allowed are {names}")
            if not isinstance(content, Mapping):
                raise SceneError(
                    f"{where}: {table} must be a table, got {_short(content)}", f"write [{table}] above its keys"
                )
            for key, value in content.items():
                if key not in allowed:
                    raise SceneError(
                        f"{where}: unknown key {_short(key)} in [{table}] (value {_short(value)})",
                        f"allowed are {', '.join(allowed)}",
                    )
                if (table, key) in _CHOICES:
                    attribute, texts = _CHOICES[table, key]
                    known[attribute] = _choice(table, key, value, texts(), where)
                else:
                    known[BENCH_KEYS[table, key].attribute] = _quantity(table, key, value, where)
        scene = cls(**known)
        _check_vapour(scene, where)
        return scene

    def to_mapping(self) -> dict[str, dict[str, Any]]:
        """Return the tables without unknown quantities; the inverse of :meth:`from_mapping`."""
        tables: dict[str, dict[str, Any]] = {}
        for (table, key), quantity in BENCH_KEYS.items():
            estimate: Estimate | None = getattr(self, quantity.attribute)
            if estimate is not None:
                plain = estimate.u == 0
                tables.setdefault(table, {})[key] = (
                    estimate.value if plain else {"value": estimate.value, "u": estimate.u}
                )
        for (table, key), (attribute, _) in _CHOICES.items():
            if (text := getattr(self, attribute)) is not None:
                tables.setdefault(table, {})[key] = text
        return tables

    @property
    def tells_of_sensor(self) -> bool:
        """Whether the scene describes a rangefinder under [sensor], and not only a noise, which all distances have."""
        given = (self.sensor_position, self.sensor_mean_samples, self.sensor_lag_s)
        return any(x is not None for x in given)


def _check_vapour(scene: Scene, where: str) -> None:
    """Reject air with more vapour than its pressure allows, even if each value is possible on its own."""
    celsius, pascal, humidity = scene.air_temperature_c, scene.air_pressure_pa, scene.air_relative_humidity
    if celsius is None or pascal is None or humidity is None:
        return
    vapour_pa = humidity.value * saturation_pressure(celsius.value)
    if vapour_pa > pascal.value:
        raise SceneError(
            f"{where}: [air] relative_humidity {humidity.value:g} at temperature_c {celsius.value:g} must leave "
            f"a vapour pressure of at most pressure_pa {pascal.value:g}, got {vapour_pa:.3g} Pa",
            "one of the three is wrong",
        )


def _choice(table: str, key: str, value: object, texts: tuple[str, ...], where: str) -> str:
    if value not in texts:
        raise SceneError(f"{where}: [{table}] {key} must be one of {', '.join(texts)}, got {_short(value)}")
    return str(value)


def _quantity(table: str, key: str, given: Any, where: str) -> Estimate:
    quantity = BENCH_KEYS[table, key]
    name = f"{where}: [{table}] {key}"
    value, u, unit = given, 0.0, ""
    if isinstance(given, Mapping):
        if "value" not in given or set(given) - {"value", "u"}:
            raise SceneError(f"{name} must be a number or {{ value = ..., u = ... }}, got {_short(dict(given))}")
        value, u = given["value"], given.get("u", 0.0)
    elif isinstance(given, str):
        try:
            read = typed(given, quantity.unit)
        except ValueError as error:
            raise SceneError(f"{name} {error}, got {_short(given)}") from error
        value, u = read.value, read.u
    elif isinstance(given, tuple) and len(given) == 2:  # as in Scene(bob_mass_kg=(0.2, 0.0001))
        value, u = given
    elif isinstance(given, Estimate):
        value, u, unit = given.value, given.u, given.unit
    elif hasattr(given, "nominal_value"):  # a UFloat, or a quantity with a unit
        value, u, unit = given.nominal_value, given.std_dev, getattr(given, "unit", "")
    if unit and unit != quantity.unit:
        raise SceneError(f"{name} must be in {quantity.unit or 'no unit'}, got {unit}")
    number, spread = _number(value, name), _number(u, f"{name}, its u")
    if not quantity.least <= number <= quantity.greatest:
        raise SceneError(f"{name} must be {quantity.allowed()}, got {number:g}")
    if spread < 0:
        raise SceneError(f"{name}: its u must not be negative, got {spread:g}")
    if spread > quantity.greatest:
        raise SceneError(
            f"{name}: its u must be at most {quantity.greatest:g} {quantity.unit}, got {spread:g}".rstrip()
        )
    return Estimate(number, spread, quantity.unit)


def _number(value: object, name: str) -> float:
    if not isinstance(value, bool) and isinstance(value, int | float):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf  # an integer of more than 308 digits
        if math.isfinite(number):
            return number
    raise SceneError(f"{name} must be a finite number, got {_short(value)}")


def _short(value: object) -> str:
    """Return the value's Python representation, shortened if it is long."""
    try:
        words = repr(value)
    except ValueError:
        return "an integer of thousands of digits"  # Python refuses to print it
    except RecursionError:
        return "tables nested by the hundred"
    return words if len(words) <= 60 else f"{words[:57]}..."
