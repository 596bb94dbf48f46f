"""``springmass simulate``: what it prints, writes and refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.block import Block
from acquisition.source import SourceInfo
from pipeline.dynamics import Equation, Problem, get_integrator
from springmass import analyse, load
from springmass.runs.scenes import read_scene
from storage.run_file.writing import write_run

LINEAR = """
[bob]
mass_kg = 0.2
[spring]
constant_n_per_m = 20.0
[start]
displacement_m = 0.05
"""
MIXED = LINEAR + "[damping]\ngamma_per_s = 0.0073\nbeta_per_m_s = 0.235\n"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Return a scene of mixed drag."""
    path = tmp_path / "bench.scene.toml"
    path.write_text(MIXED)
    return path


def test_auto_keeps_the_tolerance_and_says_so(cli: Callable, scene: Path) -> None:
    """The object holds method, step, predicted and measured error, both below the tolerance."""
    done = cli("simulate", "--scene", scene, "--seconds", "30", "--tolerance", "1e-7", "--check", "--json")
    assert done.code == 0
    (found,) = done.results
    assert found["measured_error"] <= found["predicted_error"] <= 1e-7
    assert found["method"] == "strang"
    assert found["samples"] == 3001
    assert {t["name"]: t["included"] for t in found["terms"]} == {
        "viscous_drag": True,
        "quadratic_drag": True,
        "friction": False,
        "amplitude_dependent_frequency": False,
    }
    assert done.err.index("predicted error") < done.err.index("measured error")


def test_a_linear_scene_is_solved_exactly(cli: Callable, tmp_path: Path) -> None:
    """Nothing but a spring: the exact propagator, and no term left in."""
    path = tmp_path / "linear.toml"
    path.write_text(LINEAR)
    (found,) = cli("simulate", "--scene", path, "--check", "--json").results
    assert found["method"] == "exact"
    assert 0.0 < found["measured_error"] < 1e-10
    assert found["equation"]["angular_frequency_per_s"] == 10.0


def test_run_file_and_figures_are_written(cli: Callable, scene: Path, tmp_path: Path) -> None:
    """NAME.simulated holds a run of kind simulated whose analysis finds the scene, and every figure twice."""
    done = cli("simulate", "--scene", scene, "--seconds", "20", "--check", "--out", tmp_path / "out")
    assert done.code == 0
    folder = tmp_path / "out" / "bench.simulated"
    loaded = load(folder / "run.h5")
    assert loaded.info.kind == "simulated"
    found = analyse(loaded.track, read_scene(scene))
    assert found.estimates["spring_constant"].value == pytest.approx(20.0, rel=1e-4)
    assert found.estimates["amplitude"].value == pytest.approx(0.05, rel=1e-3)
    figures = {path.name for path in (folder / "figures").iterdir()}
    names = ("position", "velocity", "energy", "phase", "error")
    assert figures == {f"{name}.{kind}" for name in names for kind in ("svg", "pdf")}
    for name in names[:4]:
        text = (folder / "figures" / f"{name}.svg").read_text(encoding="utf-8")
        assert all(word in text for word in ("forward Euler", "symplectic Euler", "exact"))
    results = json.loads((folder / "simulation.json").read_text())
    assert results["method"] in done.out or "Strang" in done.out


def test_an_unstable_step_is_refused_with_limit_and_remedy(cli: Callable, scene: Path, tmp_path: Path) -> None:
    """One line, exit code 2, nothing written; --force runs it and measures how wrong it is."""
    arguments = ("simulate", "--scene", scene, "--method", "forward-euler", "--out", tmp_path / "out")
    done = cli(*arguments)
    assert done.code == 2
    assert "unstable" in done.complaint
    limit = float(done.complaint.split("--dt ")[1].split()[0])
    assert limit == pytest.approx(2 * 0.0073 / 100.0, rel=0.01)
    assert limit <= 2 * 0.0073 / 100.0
    assert "--method strang" in done.complaint
    assert "--force" in done.complaint
    assert not (tmp_path / "out").exists()
    forced = cli(*arguments, "--force", "--check", "--json")
    assert forced.results[0]["measured_error"] > 1.0
    assert cli(*arguments[:-2], "--dt", str(limit), "--seconds", "1", "--json").code == 0


@pytest.mark.parametrize("name", ["lsoda", "dop853"])
def test_scipy_solves_a_scene(cli: Callable, scene: Path, name: str) -> None:
    """scipy's methods run as they are, at a local tolerance that aims at 1e-6 of the amplitude."""
    (found,) = cli("simulate", "--scene", scene, "--method", name, "--check", "--json").results
    assert found["method"] == name
    assert 0.0 < found["measured_error"] < 1e-5
    assert 0.0 < found["predicted_error"] <= 1e-6


@pytest.mark.trials
def test_a_prediction_is_laid_over_a_run(cli: Callable, scene: Path, tmp_path: Path) -> None:
    """The start is the run's, what the scene leaves out its analysis's; what is left is small, and drawn."""
    assert cli("simulate", "--scene", scene, "--seconds", "20", "--out", tmp_path).code == 0
    bare = tmp_path / "bare.toml"
    bare.write_text("[bob]\nmass_kg = 0.2\n")
    run = tmp_path / "bench.simulated" / "run.h5"
    done = cli("simulate", "--scene", bare, "--against", run, "--out", tmp_path, "--json")
    assert done.code == 0
    assert "spring_constant_n_per_m" in done.err
    assert done.results[0]["against"]["rms_m"] < 2e-4
    assert (tmp_path / "bare.simulated" / "figures" / "against.svg").is_file()
    assert cli("simulate", "--scene", scene, "--out", tmp_path).code == 0
    assert not (tmp_path / "bench.simulated" / "figures" / "against.svg").exists()


def test_the_prediction_is_that_of_the_method_and_step_asked_for(cli: Callable, tmp_path: Path) -> None:
    """Forward Euler's distance from a run that moves exactly is forward Euler's error, in the step that was given."""
    path = tmp_path / "linear.toml"
    path.write_text(LINEAR + "[damping]\ngamma_per_s = 0.1\n")
    assert cli("simulate", "--scene", path, "--method", "exact", "--out", tmp_path).code == 0
    run = tmp_path / "linear.simulated" / "run.h5"
    problem = Problem(Equation(angular_frequency_per_s=10.0, gamma_per_s=0.1), 0.05)
    truth = get_integrator("exact").run(problem, 0.01, 1000).y
    found = {}
    for method, step in (("exact", 0.01), ("auto", 0.01), ("forward-euler", 0.001), ("forward-euler", 0.0005)):
        arguments = ("--scene", path, "--against", run, "--method", method, "--dt", str(step), "--json")
        (result,) = cli("simulate", *arguments).results
        found[method, step] = result["against"]["rms_m"]
        if method == "forward-euler":
            every = round(0.01 / step)
            off = get_integrator(method).run(problem, step, 1000 * every, every=every).y - truth
            assert found[method, step] == pytest.approx(np.sqrt(np.mean(off**2)), rel=0.05)
    # The start is read off windows of the record, none of whose samples is left out: two millionths of the amplitude.
    assert max(found["exact", 0.01], found["auto", 0.01]) < 2e-6 * 0.05
    assert found["forward-euler", 0.001] > 1.9 * found["forward-euler", 0.0005] > 1e-3


@pytest.mark.trials
def test_uncertainties_of_the_scene_make_a_band(cli: Callable, tmp_path: Path) -> None:
    """Its width stands in the JSON, its quantiles in the tables and figures; without uncertainties it is said."""
    path = tmp_path / "vague.toml"
    path.write_text(MIXED.replace("0.05\n", "{ value = 0.05, u = 0.001 }\n"))
    done = cli("simulate", "--scene", path, "--out", tmp_path, "--json")
    assert "by linear propagation of the uncertainties of start_displacement_m" in done.err
    band = done.results[0]["band"]
    assert band["quantities"] == ["start_displacement_m"]
    assert (band["members"], band["seed"], band["linear"]) == (2500, 0, True)
    assert band["displacement_half_width_68_m"] == pytest.approx(1e-3, rel=0.02)
    assert band["amplitude_half_width_95_m"] == pytest.approx(1.96e-3, rel=0.02)
    folder = tmp_path / "vague.simulated"
    table = np.genfromtxt(folder / "band.csv", delimiter=",", names=True)
    assert table.size == 1001
    levels = [table[f"displacement_{level}_m"][0] for level in ("low_95", "low_68", "high_68", "high_95")]
    np.testing.assert_allclose(levels, 0.05 + 1e-3 * np.array([-1.96, -1.0, 1.0, 1.96]), atol=5e-5)
    assert np.all(table["amplitude_low_68_m"] < table["amplitude_m"])
    assert "amplitude" in (folder / "figures" / "band.svg").read_text(encoding="utf-8")
    run = folder / "run.h5"
    done = cli("simulate", "--scene", path, "--against", run, "--out", tmp_path, "--json")
    assert "start_velocity_m_per_s" in done.results[0]["band"]["quantities"]
    table = np.genfromtxt(folder / "against.csv", delimiter=",", names=True)
    assert np.all(table["predicted_low_95_m"] <= table["predicted_high_95_m"])
    assert np.sqrt(np.mean((table["measured_m"] - table["predicted_m"]) ** 2)) == pytest.approx(
        done.results[0]["against"]["rms_m"], rel=1e-3
    )
    path.write_text(MIXED)
    done = cli("simulate", "--scene", path, "--out", tmp_path, "--json")
    assert "band             none: the scene states no uncertainties" in done.err
    assert done.results[0]["band"] is None
    assert not any((folder / name).exists() for name in ("band.csv", "against.csv", "figures/band.pdf"))


def test_a_run_at_rest_takes_no_prediction(cli: Callable, scene: Path, tmp_path: Path) -> None:
    """Exit code 3, one line."""
    noise = np.random.default_rng(1).normal(0.25, 1e-4, 1000)
    samples = Block(0, np.arange(1000) / 100.0, noise, np.zeros(1000, np.uint8))
    still = write_run(tmp_path / "still.h5", [samples], SourceInfo("simulated", "still", 100.0))
    done = cli("simulate", "--scene", scene, "--against", still, "--json")
    assert done.code == 3
    assert "nothing to lay a prediction over" in done.complaint


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--method", "leapfrog"), "allowed are auto, forward-euler"),
        (("--dt", "0"), "--dt must be more than 0 s"),
        (("--dt", "-0.01"), "--dt must be more than 0 s"),
        (("--tolerance", "1e-17"), "must be finite and at least"),
        (("--tolerance", "0"), "must be finite and at least"),
        (("--tolerance", "-1"), "must be finite and at least"),
        (("--method", "verlet", "--tolerance", "1e-12"), "verlet cannot keep a tolerance of 1e-12"),
        (("--method", "exact"), "exact cannot solve this"),
        (("--seconds", "1e9"), "makes 100000000000 steps"),
        (("--seconds", "0.001"), "makes 0 steps"),
        (("--dt", "1e-200", "--seconds", "1e-199"), "the step must be between 1e-100 and 1e+100 s, got 1e-200"),
        (("--dt", "1e200", "--seconds", "1e201"), "the step must be between 1e-100 and 1e+100 s, got 1e+200"),
    ],
)
def test_bad_input_is_one_line_with_code_two(
    cli: Callable, scene: Path, arguments: tuple[str, ...], message: str
) -> None:
    """What cannot be is said before anything is written."""
    done = cli("simulate", "--scene", scene, "--json", *arguments)
    assert (done.code, done.out) == (2, "")
    assert message in done.complaint


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg = 0.2", "mass_kg = -0.2", "mass_kg must be more than 0 kg"),
        ("displacement_m = 0.05", "displacement_m = nan", "finite number"),
        ("constant_n_per_m = 20.0", "mass_kg = 0.01", "constant_n_per_m"),
        ("constant_n_per_m = 20.0", "constant_n_per_m = 20.0\ncubic_n_per_m3 = -9000.0", "softening spring"),
    ],
)
def test_a_scene_that_cannot_move_is_one_line(cli: Callable, tmp_path: Path, old: str, new: str, message: str) -> None:
    """Negative mass, a start that is no number, no spring, a spring that lets go: exit code 2."""
    path = tmp_path / "bad.toml"
    path.write_text(MIXED.replace(old, new))
    done = cli("simulate", "--scene", path, "--json")
    assert (done.code, done.out) == (2, "")
    assert message in done.complaint


def test_friction_stops_the_simulated_bob(cli: Callable, tmp_path: Path) -> None:
    """A scene with friction ends at rest, in the run file too."""
    path = tmp_path / "friction.toml"
    path.write_text(LINEAR + "[damping]\nmu_m_per_s = 0.02\n")
    assert cli("simulate", "--scene", path, "--out", tmp_path).code == 0
    samples = load(tmp_path / "friction.simulated" / "run.h5").samples
    assert np.ptp(samples.distance[-400:]) == 0.0
    assert np.all(samples.velocity[-400:] == 0.0)


BENCH = """
[bob]
mass_kg = { value = 0.2176, u = 0.00005 }
[spring]
mass_kg = { value = 0.0100, u = 0.0005 }
constant_n_per_m = { value = 14.0, u = 0.01 }
[disc]
diameter_m = { value = 0.102, u = 0.0005 }
[air]
temperature_c = 20.0
[start]
displacement_m = { value = 0.05, u = 0.0002 }
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """Return a scene of disc and air without damping."""
    path = tmp_path / "disc.toml"
    path.write_text(BENCH)
    return path


def test_the_scene_decides_what_acts(cli: Callable, bench: Path) -> None:
    """Disc and air damp a motion whose damping nobody stated, each effect has its size; --without leaves one out."""
    (found,) = cli("simulate", "--scene", bench, "--seconds", "120", "--json").results
    effects = {effect["name"]: effect for effect in found["effects"]}
    assert effects["disc_drag"]["included"]
    assert "Graham 1980" in effects["disc_drag"]["why"]
    assert effects["disc_drag"]["predicted"] == pytest.approx(0.64, abs=0.05)
    assert effects["spring_mass"]["predicted"] == pytest.approx(2.0, abs=0.01)
    assert effects["sideways_mode"]["predicted"] is None
    assert found["equation"]["drag_per_m"] > 0.0
    done = cli("simulate", "--scene", bench, "--seconds", "120", "--without", "drag", "--json")
    (found,) = done.results
    assert found["equation"]["drag_per_m"] == found["equation"]["gamma_per_s"] == 0.0
    assert "left out by --without" in done.err


def test_readings_are_a_recording_like_any_other(cli: Callable, bench: Path, tmp_path: Path) -> None:
    """With noise and echoes by choice, of kind simulated, and its analysis finds the scene's spring again."""
    run = tmp_path / "bench.h5"
    arguments = ("simulate", "--scene", bench, "--seconds", "30", "-o", run, "--noise-m", "2e-4", "--echoes", "0")
    assert cli(*arguments).code == 0
    loaded = load(run)
    assert loaded.info.kind == "simulated"
    found = analyse(loaded.track, read_scene(bench))
    assert found.estimates["noise"].value == pytest.approx(2e-4, rel=0.1)
    constant = found.estimates["spring_constant"]
    assert abs(constant.value - 14.0) < 4.0 * constant.u
    assert cli(*arguments).code == 2
    assert cli(*arguments, "--overwrite", "--seed", "1").code == 0
    assert "add -o RUN.h5" in cli("simulate", "--scene", bench, "--noise-m", "1e-4").complaint


@pytest.mark.parametrize("tolerance", ["1e-3", "1e-9"])
def test_what_is_read_without_noise_gets_no_warning(cli: Callable, bench: Path, tmp_path: Path, tolerance: str) -> None:
    """Of the motion itself no echo is false, no residual correlated, and no frequency bends but as drag bends it."""
    run = tmp_path / "exact.h5"
    wanted = ("--sensor", "ideal", "--seconds", "60", "--tolerance", tolerance)
    assert cli("simulate", "--scene", bench, "-o", run, *wanted).code == 0
    found = cli("analyse", run, "--json").results[0]["findings"]
    assert [each["code"] for each in found if each["severity"] != "info"] == []
    assert "false_echoes" not in {each["code"] for each in found}


def test_a_record_outside_the_band_names_what_would_have_to_move(cli: Callable, bench: Path, tmp_path: Path) -> None:
    """A run of another spring leaves the band, and the spring constant is named with the value that it had."""
    other = tmp_path / "other.toml"
    other.write_text(BENCH.replace("value = 14.0", "value = 14.08"))
    run = tmp_path / "other.h5"
    assert cli("simulate", "--scene", other, "--seconds", "30", "-o", run, "--echoes", "0").code == 0
    done = cli("simulate", "--scene", bench, "--against", run, "--json")
    against = done.results[0]["against"]
    assert against["leaves_s"] is not None
    assert against["inside_95"] < 0.9
    moves = {move["name"]: move for move in against["moves"]}
    assert moves["spring_constant_n_per_m"]["to"] == pytest.approx(14.08, abs=0.02)
    assert "alone would have to be" in done.err
    same = cli("simulate", "--scene", other, "--against", run, "--json").results[0]["against"]
    assert same["leaves_s"] is None
    assert same["inside_95"] > 0.93


def test_a_hard_spring_and_a_long_run_are_solved(cli: Callable, tmp_path: Path) -> None:
    """A cubic term of a million times the spring's pull does not throw auto; it says what it took."""
    path = tmp_path / "hard.toml"
    path.write_text(LINEAR.replace("20.0", "20.0\ncubic_n_per_m3 = 8e9") + "[damping]\ngamma_per_s = 0.01\n")
    done = cli("simulate", "--scene", path, "--seconds", "0.1", "--tolerance", "1e-4", "--json")
    assert done.code == 0
    assert done.results[0]["predicted_error"] <= 1e-4
