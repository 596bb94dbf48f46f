"""``springmass simulate``: what it prints, writes and refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from springmass import analyse, load
from springmass.charts.chart import decoded
from tests.cli.conftest import BENCH as LINEAR
from tests.cli.conftest import MIXED, Cli


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Return a scene of mixed drag."""
    path = tmp_path / "bench.scene.toml"
    path.write_text(MIXED)
    return path


@pytest.mark.parametrize(
    ("damping", "rate", "last"),
    [
        ("gamma_per_s = 0.05", 0.05, 0.05 * np.exp(-1.0)),
        ("beta_per_m_s = 1.0", 0.05, 0.05 / 2.0),
        ("mu_m_per_s = 0.001", 0.02, 0.03),
    ],
)
def test_the_prediction_is_told_in_the_quantities_of_table_1(
    cli: Cli, tmp_path: Path, damping: str, rate: float, last: float
) -> None:
    """Period, damping rate and Q at the start, and the amplitude at the end as its law says; printed and in JSON."""
    path = tmp_path / "bench.toml"
    path.write_text(f"{LINEAR}[damping]\n{damping}\n")
    done = cli("simulate", "--scene", path, "--seconds", "20", "-o", tmp_path)
    (found,) = cli("simulate", "--scene", path, "--seconds", "20", "--json").results
    predicted = found["prediction"]
    assert predicted["period_s"] == pytest.approx(0.2 * np.pi, rel=1e-4)
    assert predicted["damping_rate_per_s"] == pytest.approx(rate)
    assert predicted["quality_factor"] == pytest.approx(10.0 / (2.0 * rate))
    assert predicted["last_amplitude_m"] == pytest.approx(last, rel=0.01)
    assert f"A = {predicted['last_amplitude_m']:.4g} m after 20 s" in done.out


def test_readings_are_a_recording_whose_analysis_finds_the_scene(cli: Cli, scene: Path, tmp_path: Path) -> None:
    """A run file of kind simulated, which nothing overwrites unasked."""
    run = tmp_path / "run.h5"
    scene.write_text(f"{MIXED}[sensor]\nsigma_m = 2e-4\n")
    arguments = ("simulate", "--scene", scene, "--seconds", "20", "-o", run)
    assert cli(*arguments).code == 0
    loaded = load(run).loaded
    assert loaded.info.kind == "simulated"
    found = analyse(run, scene)
    assert found["noise"].value == pytest.approx(2e-4, rel=0.1)
    assert abs(found["spring_constant"].value - 20.0) < 4.0 * found["spring_constant"].u
    assert cli(*arguments).code == 2


def test_an_unstable_step_is_refused_with_limit_and_remedy(cli: Cli, scene: Path, tmp_path: Path) -> None:
    """One line, exit code 2, nothing written; --force runs it and measures how wrong it is."""
    arguments = ("simulate", "--scene", scene, "--seconds", "10", "--method", "forward-euler")
    arguments += ("-o", tmp_path / "out")
    done = cli(*arguments)
    assert done.code == 2
    limit = float(done.complaint.split("--dt ")[1].split()[0])
    assert limit == pytest.approx(2 * 0.0073 / 100.0, rel=0.01)
    assert limit <= 2 * 0.0073 / 100.0
    assert not (tmp_path / "out").exists()
    forced = cli(*arguments[:-2], "--force", "--check", "--json")
    assert forced.results[0]["measured_error"] > 1.0
    assert cli(*arguments[:-2], "--dt", str(limit), "--json").code == 0


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


@pytest.mark.usefixtures("undrawn")
def test_the_charts_of_a_simulation_stand_on_a_page(cli: Cli, scene: Path, tmp_path: Path) -> None:
    """Its charts are in simulation.html, and files only on request; both Euler methods are beside the exact motion."""
    assert cli("simulate", "--scene", scene, "--seconds", "20", "-o", tmp_path, "--figures", "png").code == 0
    folder = tmp_path / "bench.simulated"
    page = (folder / "simulation.html").read_text("utf-8")
    (text,) = re.findall(r'<script type="application/json" id="charts">(.*?)</script>', page, re.DOTALL)
    charts = {chart["name"]: chart for chart in json.loads(text)}
    assert set(charts) == {"position", "velocity", "energy", "phase", "error"}
    forward, symplectic = (
        {s["role"]: decoded(s["y"]) for s in panel["series"]} for panel in charts["energy"]["panels"]
    )
    assert forward["data"][-1] > 2.0 * forward["law"][-1]
    assert symplectic["data"][-1] == pytest.approx(symplectic["law"][-1], rel=0.1)
    assert symplectic["law"][0] == pytest.approx(0.5e3 * 20.0 * 0.05**2)
    assert {path.name for path in (folder / "figures").iterdir()} == {f"{name}.png" for name in charts}


def test_a_record_outside_the_band_names_what_would_have_to_move(cli: Cli, bench: Path, tmp_path: Path) -> None:
    """A run of another spring leaves the band, and the spring constant is named with the value that it had."""
    other = tmp_path / "other.toml"
    other.write_text(BENCH.replace("value = 14.0", "value = 14.08"))
    run = tmp_path / "other.h5"
    assert cli("simulate", "--scene", other, "--seconds", "30", "-o", run).code == 0
    done = cli("simulate", "--scene", bench, "--against", run, "--json")
    against = done.results[0]["against"]
    assert against["leaves_s"] is not None
    assert against["inside_95"] < 0.9
    moves = {move["name"]: move for move in against["moves"]}
    assert moves["spring_constant_n_per_m"]["to"] == pytest.approx(14.08, abs=0.02)
    same = cli("simulate", "--scene", other, "--against", run, "--json").results[0]["against"]
    assert same["leaves_s"] is None
    assert same["inside_95"] > 0.93


def test_a_run_with_its_scene_is_enough(cli: Cli, scene: Path, tmp_path: Path) -> None:
    """Start, constant and damping come from the recording, the mass from its scene, and the length is the run's."""
    run, full = tmp_path / "bob.h5", MIXED
    scene.write_text(full)
    assert cli("simulate", "--scene", scene, "--seconds", "30", "--sensor", "ideal", "-o", run).code == 0
    only_mass = tmp_path / "mass.toml"
    only_mass.write_text("[bob]\nmass_kg = 0.2\n")
    assert cli("scene", run, "--scene", only_mass).code == 0
    done = cli("simulate", "--against", run, "--json")
    (found,) = done.results
    assert found["samples"] == pytest.approx(3001, abs=1)
    assert found["equation"]["angular_frequency_per_s"] == pytest.approx(10.0, rel=1e-4)
    assert found["equation"]["gamma_per_s"] == pytest.approx(0.0073, rel=0.05)
    assert found["against"]["rms_m"] < 1e-4
    # Values that the run gave are marked; those that its scene states, here of the whole bench, agree with the run.
    taken = cli("simulate", "--against", run, "-o", tmp_path).out
    assert taken.count("from the run") == 4
    table = cli("simulate", "--scene", scene, "--against", run, "-o", tmp_path).out.partition("difference / u")[2]
    apart = {line.split("  ")[0]: float(line.split()[-1]) for line in table.splitlines()[2:5]}
    assert set(apart) == {"period", "damping rate at the start", "quality factor"}
    assert all(abs(each) < 4.0 for each in apart.values())
    (missing,) = [cli("simulate", "--json")]
    assert missing.code == 2
    assert "--against RUN" in missing.complaint


@pytest.mark.parametrize("step_s", [0.002, 0.01, 0.03])
def test_forward_euler_grows_by_its_formula(cli: Cli, tmp_path: Path, step_s: float) -> None:
    """Each step multiplies the amplitude by sqrt(1 + w^2 h^2), that of symplectic Euler keeps it; measured alike."""
    path = tmp_path / "linear.toml"
    path.write_text(LINEAR)
    (found,) = cli("simulate", "--scene", path, "--dt", step_s, "--json").results
    forward, symplectic = found["growth"]
    assert forward["predicted"] == pytest.approx(np.sqrt(1.0 + (10.0 * step_s) ** 2), rel=1e-12)
    assert forward["measured"] == pytest.approx(forward["predicted"], rel=1e-6)
    assert forward["fails_above_s"] == 0.0
    assert symplectic["measured"] == pytest.approx(1.0, abs=2e-5)
    assert symplectic["fails_above_s"] == pytest.approx(0.2)


def test_the_measured_run_stands_in_the_charts_of_both_methods(cli: Cli, scene: Path, tmp_path: Path) -> None:
    """Position, velocity, energy and phase have the recording, which is the exact motion here, as their points."""
    run = tmp_path / "bob.h5"
    assert cli("simulate", "--scene", scene, "--seconds", "20", "--sensor", "ideal", "-o", run).code == 0
    assert cli("simulate", "--against", run, "-o", tmp_path).code == 0
    assert not (tmp_path / "bob.h5.simulated" / "figures").exists()
    page = (tmp_path / "bob.h5.simulated" / "simulation.html").read_text("utf-8")
    (text,) = re.findall(r'<script type="application/json" id="charts">(.*?)</script>', page, re.DOTALL)
    charts = {chart["name"]: chart for chart in json.loads(text)}
    for name in ("position", "velocity", "energy", "phase"):
        for panel in charts[name]["panels"]:
            measured, _, exact = panel["series"]
            assert measured["label"] == "measured"
            assert decoded(measured["y"])[0] == pytest.approx(decoded(exact["y"])[0], rel=0.01, abs=0.01)
