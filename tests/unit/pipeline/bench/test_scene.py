"""A scene says what is at the bench; what it may not say is refused by file, key, value and what is allowed."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.bench.scene import Scene
from pipeline.errors import PipelineError, SceneError
from pipeline.numerics.estimate import Estimate

WHOLE = {
    "bob": {"mass_kg": {"value": 0.2176, "u": 0.00005}},
    "spring": {"mass_kg": {"value": 0.01, "u": 0.0005}, "constant_n_per_m": 14.0},
    "disc": {"diameter_m": {"value": 0.102, "u": 0.0005}},
    "air": {"temperature_c": 20.0, "pressure_pa": 101325, "relative_humidity": 0.4},
    "sensor": {"position": "below", "sigma_m": 0.0003},
    "start": {"displacement_m": -0.05, "velocity_m_per_s": 0.0},
    "damping": {"gamma_per_s": 0.0073, "beta_per_m_s": 0.235, "mu_m_per_s": 0.0},
}


def test_every_key_of_the_reference_scene_is_read() -> None:
    """Each quantity arrives with its value, uncertainty and unit."""
    scene = Scene.from_mapping(WHOLE)
    assert scene == Scene(
        bob_mass_kg=Estimate(0.2176, 0.00005, "kg"),
        spring_mass_kg=Estimate(0.01, 0.0005, "kg"),
        spring_constant_n_per_m=Estimate(14.0, 0.0, "N/m"),
        disc_diameter_m=Estimate(0.102, 0.0005, "m"),
        air_temperature_c=Estimate(20.0, 0.0, "degC"),
        air_pressure_pa=Estimate(101325.0, 0.0, "Pa"),
        air_relative_humidity=Estimate(0.4, 0.0, ""),
        sensor_sigma_m=Estimate(0.0003, 0.0, "m"),
        sensor_position="below",
        start_displacement_m=Estimate(-0.05, 0.0, "m"),
        start_velocity_m_per_s=Estimate(0.0, 0.0, "m/s"),
        gamma_per_s=Estimate(0.0073, 0.0, "1/s"),
        beta_per_m_s=Estimate(0.235, 0.0, "1/(m s)"),
        mu_m_per_s=Estimate(0.0, 0.0, "m/s"),
    )
    assert scene.tells_of_bench


def test_nothing_known_is_empty() -> None:
    """No tables, and tables without keys, leave every quantity None."""
    for tables in ({}, {"bob": {}, "sensor": {}}):
        scene = Scene.from_mapping(tables)
        assert scene == Scene()
        assert scene.to_mapping() == {}


def test_a_sensor_alone_is_no_bench() -> None:
    """A scene that only says where the sensor is tells of no bench; one with a bob, or with air, does."""
    assert not Scene.from_mapping({"sensor": {"position": "above"}}).tells_of_bench
    assert Scene.from_mapping({"air": {"relative_humidity": 0.4}}).tells_of_bench


# table, key, value, words that the message must hold besides file, table, key and value
REFUSED: list[tuple[str, str, Any, tuple[str, ...]]] = [
    ("bob", "mass_g", 200.0, ("unknown key", "200", "mass_kg")),
    ("bob", "mass", 0.2, ("unknown key", "0.2", "mass_kg")),
    ("disc", "diameter_cm", 10.2, ("unknown key", "10.2", "diameter_m")),
    ("air", "temperature_k", 293.0, ("unknown key", "293", "temperature_c", "pressure_pa", "relative_humidity")),
    ("sensor", "height_m", 1, ("unknown key", "1", "sigma_m", "position")),
    ("bob", "mass_kg", -0.2, ("more than 0 kg", "-0.2")),
    ("bob", "mass_kg", 0, ("more than 0 kg", "got 0")),
    ("bob", "mass_kg", {"value": -0.2, "u": 0.1}, ("more than 0 kg", "-0.2")),
    ("spring", "mass_kg", -0.01, ("at least 0 kg", "-0.01")),
    ("spring", "constant_n_per_m", 0.0, ("more than 0 N/m", "got 0")),
    ("disc", "diameter_m", 0.0, ("more than 0 m", "got 0")),
    ("air", "temperature_c", -300.0, ("at least -100 degC", "at most 200", "-300")),
    ("air", "pressure_pa", 0, ("more than 0 Pa", "got 0")),
    ("air", "relative_humidity", 40, ("at least 0", "at most 1", "40")),
    ("air", "relative_humidity", -0.1, ("at least 0", "at most 1", "-0.1")),
    ("sensor", "sigma_m", 0.0, ("more than 0 m", "got 0")),
    ("sensor", "position", "beside", ("below", "above", "beside")),
    ("sensor", "position", 1, ("below", "above", "1")),
    ("damping", "gamma_per_s", -1e-3, ("at least 0 1/s", "-0.001")),
    ("damping", "beta_per_m_s", -1, ("at least 0 1/(m s)", "-1")),
    ("damping", "mu_m_per_s", -1, ("at least 0 m/s", "-1")),
    ("bob", "mass_kg", "0.2", ("finite number", "'0.2'")),
    ("bob", "mass_kg", True, ("finite number", "True")),
    ("bob", "mass_kg", None, ("finite number", "None")),
    ("bob", "mass_kg", [0.2], ("finite number", "[0.2]")),
    ("bob", "mass_kg", math.nan, ("finite number", "nan")),
    ("bob", "mass_kg", math.inf, ("finite number", "inf")),
    ("start", "displacement_m", -math.inf, ("finite number", "-inf")),
    ("bob", "mass_kg", {"value": 0.2, "u": -0.1}, ("u", "negative", "-0.1")),
    ("bob", "mass_kg", {"value": 0.2, "u": "0.1"}, ("u", "finite number", "'0.1'")),
    ("bob", "mass_kg", {"value": 0.2, "u": math.nan}, ("u", "finite number", "nan")),
    ("bob", "mass_kg", {"value": 0.2, "sigma": 0.1}, ("value", "u", "sigma")),
    ("bob", "mass_kg", {"u": 0.1}, ("value", "0.1")),
    ("bob", "mass_kg", {}, ("value", "{}")),
    ("bob", "mass_kg", 5e-324, ("from 1e-12 to 1e+06", "4.94066e-324")),
    ("bob", "mass_kg", 1e7, ("from 1e-12 to 1e+06", "1e+07")),
    ("bob", "mass_kg", 10**400, ("finite number", "1000")),
    ("bob", "mass_kg", {"value": 0.2, "u": 1e7}, ("u", "at most 1e+06 kg", "1e+07")),
    ("bob", "mass_kg", "0" * 1000, ("finite number", "...")),
    ("disc", "diameter_m", 1e150, ("from 1e-06 to 1000", "1e+150")),
    ("start", "velocity_m_per_s", -1e9, ("at least -1e+06 m/s", "-1e+09")),
    ("damping", "beta_per_m_s", 1e308, ("at most 1e+06", "1e+308")),
]


@pytest.mark.parametrize(("table", "key", "value", "words"), REFUSED)
def test_refusal_names_file_key_value_and_what_is_allowed(
    table: str, key: str, value: object, words: tuple[str, ...]
) -> None:
    """Every impossible entry is one line with the file, the table, the key, the value and what is allowed."""
    with pytest.raises(SceneError) as raised:
        Scene.from_mapping({table: {key: value}}, where="bench.toml")
    message = str(raised.value)
    assert message.startswith("bench.toml:")
    for word in (f"[{table}]", key, *words):
        assert word in message, message
    assert "\n" not in message


def test_an_integer_that_python_does_not_print_is_refused() -> None:
    """Thousands of digits are one line too."""
    with pytest.raises(SceneError, match="finite number, got an integer of thousands of digits"):
        Scene.from_mapping({"bob": {"mass_kg": 10**5000}})


def test_air_that_its_pressure_cannot_hold_is_refused() -> None:
    """Temperature, pressure and humidity that each may be true, and together are not, are one line."""
    air = {"temperature_c": 150.0, "pressure_pa": 101325.0, "relative_humidity": 1.0}
    with pytest.raises(
        SceneError, match=r"b\.toml: \[air\] relative_humidity 1 at temperature_c 150 .*101325"
    ) as raised:
        Scene.from_mapping({"air": air}, where="b.toml")
    assert "\n" not in str(raised.value)
    assert Scene.from_mapping({"air": {**air, "relative_humidity": 0.1}}).air_relative_humidity is not None


def test_unknown_table_is_refused_with_the_known_ones() -> None:
    """A table that no scene has is named together with those that it may have."""
    with pytest.raises(SceneError, match=r"b\.toml: unknown table \[Bob\]; allowed are .*bob, spring, disc, air"):
        Scene.from_mapping({"Bob": {"mass_kg": 0.2}}, where="b.toml")


def test_number_in_place_of_a_table_is_refused() -> None:
    """`bob = 0.2` is told how a table is written."""
    with pytest.raises(SceneError, match=r"b\.toml: bob must be a table, got 0\.2; write \[bob\]"):
        Scene.from_mapping({"bob": 0.2}, where="b.toml")


def test_zero_is_allowed_where_it_means_none() -> None:
    """A massless spring, dry air, no drag and rest at the start are scenes."""
    scene = Scene.from_mapping(
        {
            "spring": {"mass_kg": 0},
            "air": {"relative_humidity": 0},
            "damping": {"gamma_per_s": 0},
            "start": {"displacement_m": 0},
        }
    )
    assert scene.spring_mass_kg == Estimate(0.0, 0.0, "kg")


def test_reference_scene_comes_back() -> None:
    """to_mapping gives the tables that from_mapping took."""
    assert Scene.from_mapping(WHOLE).to_mapping() == WHOLE


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
        "sensor": st.fixed_dictionaries({}, optional={"position": st.sampled_from(["below", "above"])}),
        "damping": st.fixed_dictionaries({}, optional={"mu_m_per_s": QUANTITY}),
    },
)


@given(SCENES)
def test_any_scene_survives_the_round_trip(tables: dict[str, Any]) -> None:
    """from_mapping of to_mapping is the same scene."""
    scene = Scene.from_mapping(tables)
    assert Scene.from_mapping(scene.to_mapping()) == scene


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


@pytest.mark.parametrize(
    ("table", "key", "value", "meant"),
    [
        ("bob", "mass_kg", 217.6, "grams: 0.2176"),
        ("spring", "mass_kg", 10.0, "grams: 0.01"),
        ("spring", "constant_n_per_m", 0.014, "N/mm: 14 or N/cm: 1.4"),
        ("disc", "diameter_m", 10.2, "centimetres: 0.102 or millimetres: 0.0102"),
        ("air", "temperature_c", 68.0, "fahrenheit: 20"),
        ("air", "pressure_pa", 1013.25, "hectopascals: 101325"),
        ("sensor", "sigma_m", 0.3, "centimetres: 0.003 or millimetres: 0.0003"),
        ("start", "displacement_m", -50.0, "centimetres: -0.5 or millimetres: -0.05"),
        ("start", "velocity_m_per_s", 100.0, "cm/s: 1 or mm/s: 0.1"),
        ("damping", "mu_m_per_s", 2.0, "cm/s: 0.02 or mm/s: 0.002"),
    ],
)
def test_a_value_that_no_bench_has_is_asked_about_with_its_likely_unit(
    table: str, key: str, value: float, meant: str
) -> None:
    """Range and likely unit stand in the clause; the unit's value is asked about no more."""
    (clause,) = Scene.from_mapping({table: {key: value}}).unusual()
    assert f"[{table}] {key} = {value:g} is beyond" in clause
    assert f"(did you mean {meant}?)" in clause
    assert Scene.from_mapping({table: {key: float(meant.rpartition(" ")[2])}}).unusual() == ()


def test_a_percentage_and_an_uncertainty_in_another_unit_are_asked_about() -> None:
    """A humidity of 40 is refused with what was meant; u = 0.5 of 0.2 kg is asked about."""
    with pytest.raises(SceneError, match=r"did you mean percent: 0\.4\?"):
        Scene.from_mapping({"air": {"relative_humidity": 40}})
    (clause,) = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.2176, "u": 0.5}}}).unusual()
    assert "as large as the value, u = 0.5" in clause
