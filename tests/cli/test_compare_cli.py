"""``springmass compare`` from the outside: what it says of runs of one spring, and what it refuses."""

import json
import math
from pathlib import Path

import pytest

import springmass
from springmass.loading.load import sample_data
from tests.cli.conftest import Cli
from tests.courses import write_recording
from tests.synthetic import Truth, noisy, times

DATA = sample_data()
BARE, DISC = (str(DATA / f"{name}_simulated_position.txt") for name in ("undamped", "damped"))
BARE_SCENE, DISC_SCENE = (str(DATA / f"{name}.scene.toml") for name in ("undamped", "damped"))
FAST = ("--accuracy", "fast")
RIGHT = [BARE, DISC, "--scene", BARE_SCENE, "--scene", DISC_SCENE]


def written_run(
    path: Path,
    *,
    omega: float,
    gamma: float = 0.006,
    beta: float = 0.2,
    seconds: float = 60.0,
    seed: int = 1,
) -> str:
    """Write a MotionSensor.vi position file of a damped oscillation; return its name."""
    truth = Truth(omega=omega, phase=0.0, gamma=gamma, beta=beta)
    return str(write_recording(path, noisy(truth, times(seconds), 1e-4, seed)))


def test_a_report_is_written_where_it_is_wanted(tmp_path: Path, cli: Cli) -> None:
    """The folder holds the page with the figure of the constants, and the JSON as printed; without --output nothing."""
    out = tmp_path / "both"
    (printed,) = cli("compare", *RIGHT, *FAST, "--output", out, "--json").results
    assert json.loads((out / "results.json").read_text("utf-8")) == printed
    page = (out / "report.html").read_text("utf-8")
    assert "damped_simulated_position" in page
    assert 'id="figure-comparison' in page


def five_masses(folder: Path) -> list[str]:
    """Write runs of five bobs on a spring of 14 N/m and 20 g; return the arguments that name them."""
    arguments: list[str] = []
    for grams in GRAMS:
        kg = 1e-3 * grams
        omega = math.sqrt(14.0 / (kg + 0.02 / 3 + 0.02**2 / (45 * kg)))
        run = written_run(folder / f"m{grams}.txt", omega=omega, beta=0.0, seconds=12.0, seed=grams)
        (folder / f"m{grams}.toml").write_text(f"[bob]\nmass_kg = {{ value = {kg}, u = 2e-5 }}\n")
        arguments += [run, "--scene", str(folder / f"m{grams}.toml")]
    return arguments


GRAMS = (120, 160, 200, 240, 280)
ROWS = [(g, 90 - 10 * g * 0.0981 / 14.0 + e) for g, e in zip(GRAMS, (0.04, -0.05, 0.02, 0.03, -0.04), strict=True)]


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> list[springmass.Run]:
    """Return the five runs, analysed once."""
    words = five_masses(tmp_path_factory.mktemp("masses"))
    return [springmass.analyse(run, scene) for run, scene in zip(words[::3], words[2::3], strict=True)]


def test_many_masses_and_hookes_law(tmp_path: Path, cli: Cli) -> None:
    """The line through T^2 gives k and a third of the spring's mass, and positions give k by Hooke's law, with E_n."""
    table, out = tmp_path / "hooke.csv", tmp_path / "out"
    table.write_text("mass (g),position (cm)\n" + "".join(f"{g},{y:.2f}\n" for g, y in ROWS))
    done = cli("compare", *five_masses(tmp_path), "--hooke", table, "-o", out)
    assert "Hooke's law: k = 1" in done.out
    result = json.loads((out / "results.json").read_text("utf-8"))
    line = result["mass_line"]
    assert abs(line["constant"]["value"] - 14.0) < 3 * line["constant"]["u"]
    assert abs(line["effective_mass"]["value"] - 0.02 / 3) < 3 * line["effective_mass"]["u"]
    assert result["hooke"]["constant"]["value"] == pytest.approx(14.0, abs=0.2)
    assert result["hooke"]["normalised_error"] < 1.0
    page = (out / "report.html").read_text("utf-8")
    assert all(f'id="figure-{chart}' in page for chart in ("masses", "hooke"))


@pytest.mark.parametrize("head", ["mass_g;position_cm", "Masse (g);Auslenkung (cm)", "load (g);reading (cm)"])
def test_a_static_measurement_may_have_decimal_commas(
    head: str, analysed: list[springmass.Run], tmp_path: Path
) -> None:
    """As a sheet of another language writes it, with units in its names."""
    rows = "".join(f"{g};{y:.2f}\n".replace(".", ",") for g, y in ROWS)
    (tmp_path / "hooke.csv").write_text(f"{head}\n{rows}")
    found = springmass.compare(analysed, hooke=tmp_path / "hooke.csv").hooke
    assert found is not None
    assert found.constant.value == pytest.approx(14.0, abs=0.2)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("weight,position_m\n1,2\n", "expected one column of loads and one of positions"),
        ("mass_kg,position_m\n0.1,far\n", "line 2: position_m must be a finite number"),
        ("mass_kg,position_m\n0.1,0.5\n0.2,0.4\n", "three masses"),
        ("mass_kg,position_m\n0.1,0.5\n0.2,0.4\n0.3,0.52\n", "do not follow the masses"),
    ],
)
def test_a_static_measurement_that_gives_no_constant_is_one_line(
    table: str, words: str, analysed: list[springmass.Run], tmp_path: Path
) -> None:
    """The error says what to write or to do."""
    (tmp_path / "hooke.csv").write_text(table)
    with pytest.raises(springmass.Error, match=words):
        springmass.compare(analysed, hooke=tmp_path / "hooke.csv")


def test_runs_of_one_bob_that_differ_in_damping_are_told(tmp_path: Path, cli: Cli) -> None:
    """Where two runs of one bob follow laws with other coefficients a warning says so, and k agrees all the same."""
    omega = math.sqrt(14.0 / (0.2176 + 0.01 / 3 + 8 / 3 * 1.1999 * 0.051**3))
    runs = [
        written_run(tmp_path / f"{name}.txt", omega=omega, beta=beta, seed=seed)
        for name, beta, seed in (("still_air", 0.2, 1), ("draught", 0.3, 2))
    ]
    (result,) = cli("compare", *runs, "--scene", DISC_SCENE, "--json").results
    assert result["comparison"]["agree"] is True
    assert [f["code"] for f in result["findings"]] == ["laws_differ"]
