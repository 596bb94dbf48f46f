"""Which of several lines is analysed: one that a drive or the mains keep up is not, and twice a frequency is named."""

import math

import numpy as np
import pytest

from pipeline.analyse import analyse
from pipeline.bench.scene import Scene
from pipeline.errors import SceneError
from pipeline.track import Track
from tests.synthetic import solved
from tests.trials.grades import kinds


@pytest.mark.parametrize(
    ("kind", "named"), [("driven", "driven"), ("mains-hum", "driven"), ("cantilever-overtone", "overtone")]
)
def test_what_falls_is_analysed_beside_another_line(kind: str, named: str) -> None:
    """The values are those of the free motion, and a steady line or an overtone that is as large is named."""
    record = kinds.trouble(kind, 0)
    said = record.said()
    errors = said.errors(record.truth)
    assert errors
    assert max(map(abs, errors.values())) < 4.0
    assert named in said.warnings


@pytest.mark.parametrize(("kind", "count"), [("three-modes", 3), ("close-modes", 2)])
def test_oscillations_that_overlap_are_listed(kind: str, count: int) -> None:
    """Frequencies and sizes are listed where one oscillation does not describe the record, and no period is sound."""
    for seed in range(3):
        record = kinds.trouble(kind, seed)
        findings = {each.code: each for each in analyse(Track.from_arrays(record.t, record.y)).findings}
        found = findings.get("several_lines") or findings["no_oscillation"]
        assert found.message.count(" Hz") == count
        assert not any(value.sound for name, value in record.said().values.items() if name.startswith("period"))


@pytest.mark.parametrize("kind", ["magnitude", "radial-acceleration", "magnet-pendulum"])
def test_two_cycles_in_each_of_the_motion_are_named(kind: str) -> None:
    """No value is sound, and the period of the motion is offered."""
    record = kinds.trouble(kind, 1)
    said = record.said()
    assert not any(value.sound for value in said.values.values())
    analysis = analyse(Track.from_arrays(record.t, record.y, unit=record.unit))
    offered = next(finding.values["motion_s"] for finding in analysis.findings if finding.code == "half_frequency")
    period = record.truth["period"]
    low, high = period if isinstance(period, tuple) else (period, period)
    assert 0.999 * low < offered < 1.001 * high


def test_nothing_asks_for_a_spring_where_there_is_none() -> None:
    """A slow torsion balance raises nothing, and has no spring constant, if the scene says that no spring bears it."""
    record = kinds.trouble("cavendish-spot", 1)
    track = Track.from_arrays(record.t, record.y)
    assert "implausible_sag" in {each.code for each in analyse(track).findings}
    scene = Scene.from_mapping({"bob": {"mass_kg": {"value": 0.1, "u": 1e-4}}, "spring": {"none": True}})
    assert Scene.from_mapping(scene.to_mapping()) == scene
    analysis = analyse(track, scene)
    assert {each.code for each in analysis.findings if each.severity != "info"} == {"short_record"}
    assert "spring_constant" not in analysis.estimates
    assert abs(analysis.estimates["period"].value / record.truth["period"] - 1.0) < 0.01  # type: ignore[operator]
    for wrong in ({"none": "perhaps"}, {"none": True, "mass_kg": 0.01}):
        with pytest.raises(SceneError):
            Scene.from_mapping({"spring": wrong})


@pytest.mark.parametrize(("mean_s", "jitter"), [(0.45, 0.3), (0.55, 1.0), (1.2, 0.4)])
def test_uneven_times_show_a_line_beyond_half_of_their_rate(mean_s: float, jitter: float) -> None:
    """Times without aliases give the period from less than two readings a period; nearly even ones are too slow."""
    rng = np.random.default_rng(3)
    for uneven in (True, False):
        t = np.cumsum(mean_s * (1.0 + (jitter if uneven else 0.01) * rng.uniform(-1.0, 1.0, 240)))
        y = 0.26 + 0.05 * np.cos(math.tau * t / 0.79) + 5e-4 * rng.standard_normal(t.size)
        analysis = analyse(Track.from_arrays(t, y))
        codes = {finding.code for finding in analysis.findings}
        if uneven:
            period = analysis.estimates["period"]
            assert abs(period.value - 0.79) < 4.0 * period.u < 1e-3
            assert "undersampled" not in codes
        else:
            assert codes & {"undersampled", "no_oscillation"}


def test_a_shaken_structure_has_a_period_and_no_damping_rate() -> None:
    """Its amplitude and phase wander at random: u of the period is that of the walk of the phase."""
    for seed in range(3):
        record = kinds.trouble("ambient", seed)
        said = record.said()
        assert said.warnings == {"random_excitation"}
        assert abs(said.errors(record.truth)["period"]) < 3.0
        assert said.values["period"].u > 1e-3 * said.values["period"].value
        assert "damping_rate" not in said.values


@pytest.mark.parametrize("ratio", [0.6, 0.95, 1.2])
@pytest.mark.parametrize("gamma", [0.02, 0.15])
def test_the_free_oscillation_of_a_driven_bob_is_analysed(ratio: float, gamma: float) -> None:
    """Its frequency and damping rate are those of the transient, for drives below and above the resonance."""
    omega, t = 8.3, np.arange(3000) / 50.0
    drive = ratio * omega
    x, _ = solved(
        lambda at, x, v: -(omega**2) * x - 2.0 * gamma * v + 0.02 * abs(omega**2 - drive**2) * math.sin(drive * at),
        0.0,
        t,
    )
    found = analyse(Track.from_arrays(t, 0.4 + x + 3e-4 * np.random.default_rng(6).standard_normal(t.size)))
    free = math.sqrt(omega**2 - gamma**2)
    assert abs(found.estimates["angular_frequency"].value - free) < 4.0 * found.estimates["angular_frequency"].u
    assert abs(found.estimates["damping_rate"].value - gamma) < 4.0 * found.estimates["damping_rate"].u
    assert any(finding.code == "driven" for finding in found.findings)
