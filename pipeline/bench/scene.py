"""Scene: bob, spring, disc, air and sensor at the bench, with uncertainties; unknown quantities are None."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pipeline.bench.air import saturation_pressure
from pipeline.bench.law_names import law_names
from pipeline.bench.typed import typed
from pipeline.errors import SceneError
from pipeline.numerics.estimate import Estimate

TakenT = TypeVar("TakenT")
KeptT = TypeVar("KeptT")
POSITIONS = ("below", "above")


class _Field(Generic[TakenT, KeptT]):
    """A field of a scene, which takes what can be made of it and keeps what was made; None if it is unknown."""

    place: tuple[str, str]  # table and key in a scene file

    def __set_name__(self, owner: type[Scene], name: str) -> None:
        self.attribute = name

    def __get__(self, scene: Scene | None, owner: type[Scene]) -> KeptT | None:
        return None if scene is None else scene.__dict__[self.attribute]  # that of the class is the default

    def __set__(self, scene: Scene, given: TakenT | None) -> None:
        scene.__dict__[self.attribute] = None if given is None else self.checked(given, "scene")

    def checked(self, given: Any, where: str) -> KeptT:
        """Return what is made of a value, also one of a scene file; an error names where it comes from."""
        raise NotImplementedError


class Stated(_Field[Estimate | float | str | tuple[float, float], Estimate]):
    """A quantity of a scene: its table and key in a scene file, unit, label, and allowed range with both ends.

    The ends lie far beyond any bench. The calculations are known to be valid between them, so every allowed value gives
    a number or a finding. A value with a wrong exponent is rejected when it is read.
    """

    def __init__(self, table: str, key: str, unit: str, least: float, greatest: float, label: str) -> None:
        self.place, self.unit, self.least, self.greatest = (table, key), unit, least, greatest
        self.label = label

    def allowed(self) -> str:
        """Return the range in words."""
        unit = f" {self.unit}" if self.unit else ""
        if self.least > 0.0:
            return f"more than 0{unit}, from {self.least:g} to {self.greatest:g}"
        return f"at least {self.least:g}{unit} and at most {self.greatest:g}"

    def checked(self, given: Any, where: str) -> Estimate:
        """Return the estimate of a number, of a text with its unit, of a pair (value, u), or of a table of the two."""
        table, key = self.place
        place = f"{where}: [{table}] {key}"
        value, u, unit = given, 0.0, ""
        if isinstance(given, Mapping):
            if "value" not in given or set(given) - {"value", "u"}:
                raise SceneError(
                    f"must be a number or {{ value = ..., u = ... }}, got {_short(dict(given))}", where=f"{place} "
                )
            value, u = given["value"], given.get("u", 0.0)
        elif isinstance(given, str):
            try:
                given = typed(given, self.unit)
            except ValueError as error:
                raise SceneError(f"{error}, got {_short(given)}", where=f"{place} ") from error
            value, u = given.value, given.u
        elif isinstance(given, tuple) and len(given) == 2:  # as in Scene(bob_mass_kg=(0.2, 0.0001))
            value, u = given
        elif hasattr(given, "nominal_value"):  # an estimate, or a number of the uncertainties package
            value, u, unit = given.nominal_value, given.std_dev, getattr(given, "unit", "")
        if unit and unit != self.unit:
            raise SceneError(f"must be in {self.unit or 'no unit'}, got {unit}", where=f"{place} ")
        number, spread = _number(value, f"{place} "), _number(u, f"{place}, its u ")
        if not self.least <= number <= self.greatest:
            raise SceneError(f"must be {self.allowed()}, got {number:g}", where=f"{place} ")
        if spread < 0:
            raise SceneError(f"its u must not be negative, got {spread:g}", where=f"{place}: ")
        if spread > self.greatest:
            most = f"{self.greatest:g} {self.unit}".rstrip()
            raise SceneError(f"its u must be at most {most}, got {spread:g}", where=f"{place}: ")
        return given if isinstance(given, Estimate) else Estimate(number, spread, self.unit)


class Choice(_Field[KeptT | str, KeptT]):
    """A text of a scene, or true or false: its table and key in a scene file, and what returns the allowed ones."""

    def __init__(self, table: str, key: str, allowed: Callable[[], tuple[KeptT, ...]]) -> None:
        self.place, self.allowed = (table, key), allowed

    def checked(self, given: Any, where: str) -> KeptT:
        """Return what is allowed; a command line gives true and false as a text."""
        by_text = {str(each).lower(): each for each in self.allowed()}
        if (text := str(given).lower()) not in by_text:
            table, key = self.place
            raise SceneError(f"{where}: [{table}] {key} must be one of {', '.join(by_text)}, got {_short(given)}")
        return by_text[text]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The quantities of the bench.

    Every quantity is an :class:`Estimate`, or None if it is unknown; a plain number in the scene file has ``u`` = 0.
    The attributes ``spring_constant_n_per_m``, ``spring_cubic_n_per_m3``, ``start_*`` and the damping coefficients are
    inputs of a simulation; an analysis measures them instead. ``damping_law`` is the name of the damping law if it is
    known; an analysis states its results by this law. ``spring_none`` says that no spring bears the bob, as of a
    torsion balance, a light spot or a beam.
    """

    bob_mass_kg: Stated = Stated("bob", "mass_kg", "kg", 1e-12, 1e6, "mass of the bob")
    spring_mass_kg: Stated = Stated("spring", "mass_kg", "kg", 0.0, 1e6, "mass of the spring")
    spring_none: Choice[bool] = Choice("spring", "none", lambda: (True, False))
    spring_constant_n_per_m: Stated = Stated("spring", "constant_n_per_m", "N/m", 1e-12, 1e12, "spring constant")
    spring_cubic_n_per_m3: Stated = Stated("spring", "cubic_n_per_m3", "N/m3", -1e18, 1e18, "cubic term of the spring")
    pendulum_length_m: Stated = Stated("pendulum", "length_m", "m", 1e-4, 1e4, "length of the pendulum")
    disc_diameter_m: Stated = Stated("disc", "diameter_m", "m", 1e-6, 1e3, "diameter of the disc")
    air_temperature_c: Stated = Stated("air", "temperature_c", "degC", -100.0, 200.0, "air temperature")
    air_pressure_pa: Stated = Stated("air", "pressure_pa", "Pa", 1e-3, 1e7, "air pressure")
    air_relative_humidity: Stated = Stated("air", "relative_humidity", "", 0.0, 1.0, "humidity of the air")
    sensor_sigma_m: Stated = Stated("sensor", "sigma_m", "m", 1e-12, 1e3, "noise of the sensor")
    sensor_position: Choice[str] = Choice("sensor", "position", lambda: POSITIONS)
    sensor_mean_samples: Stated = Stated("sensor", "mean_samples", "", 1.0, 1e4, "running mean of the sensor")
    sensor_lag_s: Stated = Stated("sensor", "lag_s", "s", 0.0, 1e3, "lag of the sensor")
    sensor_clock_ppm: Stated = Stated("sensor", "clock_ppm", "ppm", -1e5, 1e5, "error of the clock")
    start_displacement_m: Stated = Stated("start", "displacement_m", "m", -1e3, 1e3, "displacement at the start")
    start_velocity_m_per_s: Stated = Stated("start", "velocity_m_per_s", "m/s", -1e6, 1e6, "velocity at the start")
    gamma_per_s: Stated = Stated("damping", "gamma_per_s", "1/s", 0.0, 1e6, "linear damping")
    beta_per_m_s: Stated = Stated("damping", "beta_per_m_s", "1/(m s)", 0.0, 1e6, "quadratic damping")
    mu_m_per_s: Stated = Stated("damping", "mu_m_per_s", "m/s", 0.0, 1e6, "dry friction")
    damping_law: Choice[str] = Choice("damping", "law", law_names)

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
                field: _Field[Any, Any] = BENCH_KEYS.get((table, key)) or _CHOICES[table, key]
                known[field.attribute] = field.checked(value, where)
        scene = cls(**known)
        _check_vapour(scene, where)
        if scene.spring_none and len(tables["spring"]) > 1:
            raise SceneError(f"{where}: [spring] none = true leaves no spring to describe", "leave out its other keys")
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
        for (table, key), choice in _CHOICES.items():
            if (text := getattr(self, choice.attribute)) is not None:
                tables.setdefault(table, {})[key] = text
        return tables

    @property
    def tells_of_sensor(self) -> bool:
        """Whether the scene describes a rangefinder under [sensor], and not only a noise, which all distances have."""
        given = (self.sensor_position, self.sensor_mean_samples, self.sensor_lag_s)
        return any(x is not None for x in given)

    @property
    def hangs_on_spring(self) -> bool:
        """Whether the bob may hang on a spring: not if the scene says so, or states a pendulum and no spring."""
        return not self.spring_none and (self.pendulum_length_m is None or self.spring_mass_kg is not None)


BENCH_KEYS = {each.place: each for each in vars(Scene).values() if isinstance(each, Stated)}
_CHOICES = {each.place: each for each in vars(Scene).values() if isinstance(each, Choice)}
PLACES = {quantity.attribute: place for place, quantity in BENCH_KEYS.items()}
"""Table and key in a scene file for every quantity, by its attribute."""


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


def _number(value: object, where: str) -> float:
    if not isinstance(value, bool) and isinstance(value, int | float):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf  # an integer of more than 308 digits
        if math.isfinite(number):
            return number
    raise SceneError(f"must be a finite number, got {_short(value)}", where=where)


def _short(value: object) -> str:
    """Return the value's Python representation, shortened if it is long."""
    try:
        words = repr(value)
    except ValueError:
        return "an integer of thousands of digits"  # Python refuses to print it
    except RecursionError:
        return "tables nested by the hundred"
    return words if len(words) <= 60 else f"{words[:57]}..."
