"""A scene says what is at the bench; what it may not say is refused by file, key, value and what is allowed."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from uncertainties import ufloat

from pipeline.bench.plausible import slips
from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError, SceneError
from pipeline.numerics.estimate import Estimate

REFUSED: list[tuple[str, str, Any]] = [
    ("bob", "mass_g", 200.0),
    *(("bob", "mass_kg", wrong) for wrong in (-0.2, 0, "0.2 q", "0,2 kg", True, None, math.nan)),
    *(("bob", "mass_kg", wrong) for wrong in (math.inf, 5e-324)),
    *(("bob", "mass_kg", wrong) for wrong in (10**400, 10**5000, {"u": 0.1}, {"value": 0.2, "sigma": 0.1})),
    *(("bob", "mass_kg", {"value": value, "u": u}) for value, u in ((-0.2, 0.1), (0.2, -0.1))),
    ("spring", "mass_kg", -0.01),
    ("spring", "constant_n_per_m", 0.0),
    ("disc", "diameter_m", 0.0),
    ("air", "temperature_c", -300.0),
    ("air", "relative_humidity", 40),
    ("sensor", "sigma_m", 0.0),
    ("sensor", "position", "beside"),
    ("start", "displacement_m", -math.inf),
    ("damping", "gamma_per_s", -1e-3),
]


@pytest.mark.parametrize(("table", "key", "value"), REFUSED, ids=range(len(REFUSED)))
def test_a_refusal_names_file_table_and_key(table: str, key: str, value: object) -> None:
    """Every impossible entry is one line with the file, the table and the key."""
    with pytest.raises(SceneError) as raised:
        Scene.from_mapping({table: {key: value}}, where="bench.toml")
    message = str(raised.value)
    assert message.startswith("bench.toml:")
    assert f"[{table}]" in message
    assert key in message
    assert "\n" not in message


def test_air_that_its_pressure_cannot_hold_is_refused() -> None:
    """Temperature, pressure and humidity that each may be true, and together are not, are one line."""
    air = {"temperature_c": 150.0, "pressure_pa": 101325.0, "relative_humidity": 1.0}
    with pytest.raises(SceneError, match=r"b\.toml: \[air\] relative_humidity"):
        Scene.from_mapping({"air": air}, where="b.toml")
    assert Scene.from_mapping({"air": {**air, "relative_humidity": 0.1}}).air_relative_humidity is not None


POSITIVE = st.floats(1e-6, 1e3)
QUANTITY = st.one_of(
    POSITIVE, st.builds(lambda v, u: {"value": v, "u": u}, POSITIVE, st.floats(0.0, 1e3)), st.integers(1, 10**3)
)
SCENES = st.fixed_dictionaries(
    {},
    optional={
        "bob": st.fixed_dictionaries({}, optional={"mass_kg": QUANTITY}),
        "spring": st.fixed_dictionaries({}, optional={"mass_kg": QUANTITY, "constant_n_per_m": QUANTITY}),
        "disc": st.fixed_dictionaries({}, optional={"diameter_m": QUANTITY}),
        "air": st.fixed_dictionaries(
            {}, optional={"temperature_c": st.floats(-100.0, 90.0), "relative_humidity": st.floats(0.0, 1.0)}
        ),
        "sensor": st.fixed_dictionaries(
            {}, optional={"position": st.sampled_from(["below", "above"]), "sigma_m": POSITIVE}
        ),
        "start": st.fixed_dictionaries({}, optional={"displacement_m": st.floats(-1.0, 1.0)}),
        "damping": st.fixed_dictionaries({}, optional={"mu_m_per_s": QUANTITY}),
    },
)


@given(SCENES)
def test_any_scene_survives_the_round_trip(tables: dict[str, Any]) -> None:
    """from_mapping of to_mapping is the same scene, with the tables and keys that were given."""
    scene = Scene.from_mapping(tables)
    again = scene.to_mapping()
    assert Scene.from_mapping(again) == scene
    assert {name: set(table) for name, table in again.items()} == {name: set(t) for name, t in tables.items() if t}


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=2),
        st.dictionaries(st.sampled_from(["value", "u", "mass_kg", "position", "x"]), inner, max_size=3),
    ),
    max_leaves=4,
)


@given(st.dictionaries(st.sampled_from(["bob", "sensor", "air", "nowhere"]), JSON, max_size=3))
def test_any_tables_make_a_scene_or_a_scene_error(tables: dict[str, Any]) -> None:
    """Whatever a file holds, the outcome is a scene or one line of refusal."""
    refusal = ""
    try:
        Scene.from_mapping(tables, where="any.toml")
    except PipelineError as error:
        refusal = str(error)
    assert not refusal or refusal.startswith("any.toml:")
    assert "\n" not in refusal


def test_a_scene_is_checked_when_it_is_built() -> None:
    """Numbers, pairs of value and u, and values with uncertainty; what a file may not hold is refused."""
    assert Scene(bob_mass_kg=0.2) == Scene(bob_mass_kg=Estimate(0.2, 0.0, "kg"))
    assert Scene(bob_mass_kg=(0.2, 1e-4)) == Scene(bob_mass_kg=Estimate(0.2, 1e-4, "kg"))
    assert Scene(bob_mass_kg=ufloat(0.2, 1e-4)).bob_mass_kg == Estimate(0.2, 1e-4, "kg")
    for wrong in (
        {"bob_mass_kg": -0.2},
        {"bob_mass_kg": "0.2 cm"},
        {"disc_diameter_m": math.nan},
        {"damping_law": "none?"},
    ):
        with pytest.raises(SceneError):
            Scene(**wrong)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="must be in kg, got g"):
        Scene(bob_mass_kg=Estimate(200.0, 0.0, "g"))


TYPED: list[tuple[str, Any, float, float]] = [
    ("bob_mass_kg", "217.6+/-0.1 g", 0.2176, 1e-4),
    ("bob_mass_kg", "0.2007(1)", 0.2007, 1e-4),
    ("bob_mass_kg", "1 lb", 0.45359237, 0.0),
    ("disc_diameter_m", "10.2cm", 0.102, 0.0),
    ("air_pressure_pa", "1005 hPa", 100500.0, 0.0),
    ("air_pressure_pa", "760 mmHg", 101325.0, 0.0),
    ("air_temperature_c", "294.15 K", 21.0, 0.0),
    ("air_temperature_c", "\u22125 °C", -5.0, 0.0),
    ("air_temperature_c", "68+/-1 °F", 20.0, 5.0 / 9.0),
    ("air_relative_humidity", "40 %", 0.4, 0.0),
    ("spring_constant_n_per_m", "0.14 N/cm", 14.0, 0.0),
    ("beta_per_m_s", "0.2 1/(m s)", 0.2, 0.0),
]


@pytest.mark.parametrize(("name", "text", "value", "u"), TYPED, ids=[text for _, text, _, _ in TYPED])
def test_a_value_may_be_typed_with_its_unit(name: str, text: str, value: float, u: float) -> None:
    """A text is converted from the unit of a scale or a barometer, with its uncertainty."""
    estimate = getattr(Scene(**{name: text}), name)
    assert estimate.value == pytest.approx(value, rel=1e-6)
    assert estimate.u == pytest.approx(u, rel=1e-6)


SLIPS: list[tuple[dict[str, float], str, bool]] = [
    ({"bob_mass_kg": 217.6}, "217.6 kg or 217.6 g?", True),
    ({"bob_mass_kg": 0.2, "spring_mass_kg": 10.4}, "10.4 kg or 10.4 g?", True),
    ({"bob_mass_kg": 0.2, "spring_constant_n_per_m": 0.14}, "0.14 N/m or 0.14 N/cm?", True),
    ({"bob_mass_kg": 0.2, "disc_diameter_m": 10.2}, "10.2 m or 10.2 cm?", True),
    ({"disc_diameter_m": 10.2}, "10.2 m or 10.2 cm?", True),
    ({"air_pressure_pa": 1005.0}, "1005 Pa or 1005 hPa?", True),
    ({"air_temperature_c": 68.0}, "68 degC or 68 degF?", False),
    ({"pendulum_length_m": 250.0}, "250 m or 250 cm?", True),
    ({"sensor_sigma_m": 0.3}, "?", True),
    ({"sensor_lag_s": 20.0}, "20 s or 20 ms?", True),
    ({"start_displacement_m": -5.2}, "-5.2 m or -5.2 cm?", True),
    ({"start_velocity_m_per_s": 30.0}, "30 m/s or 30 cm/s?", True),
]


@pytest.mark.parametrize(("values", "asked", "decides"), SLIPS, ids=[slip[1] for slip in SLIPS])
def test_a_slip_of_the_unit_is_named_with_both_readings(values: dict[str, float], asked: str, decides: bool) -> None:
    """Each key, the last of the values, is judged by what its value does at a bench."""
    (slip,) = slips(Scene(**values))  # type: ignore[arg-type]
    assert slip.attribute == [*values][-1]
    assert slip.clause.endswith(asked)
    assert slip.decides == decides


def test_a_bench_of_any_size_raises_no_doubt() -> None:
    """A disc of 30 cm on 0.1 kg, a soft spring, and a pendulum of a stairwell are benches."""
    scene = Scene(bob_mass_kg=0.1, disc_diameter_m=0.3, spring_mass_kg=0.3, spring_constant_n_per_m=1.0)
    assert slips(scene) == ()
    assert slips(Scene(pendulum_length_m=67.0, air_pressure_pa=65000.0, air_temperature_c=-10.0)) == ()
