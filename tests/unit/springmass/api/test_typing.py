"""A script of a user: a type checker finds what is mistyped, and only what is needed is imported."""

import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from springmass.api.analysing import AnalysisKeywords, ReadKeywords
from springmass.loading.options import AnalysisOptions, LoadOptions

ROOT = Path(__file__).resolve().parents[4]
SCRIPT = """\
import springmass as sm

path = sm.sample_data() / "undamped_simulated_position.txt"
run = sm.analyse(path, scene=sm.Scene(bob_mass_kg=(0.2, 1e-4)), accuracy="best", laws=["none", ...], from_s=1.0)
print(run.law, run["T"].value, 2 * run["k"], run.get("gamma"), run.to_dataframe(), sm.compare([run, path]).runs)
sm.analyse(([0.0, 1.0], [0.0, 1.0]), unit="cm")
sm.analize(3)  # wrong
sm.analyse(3)  # wrong
sm.analyse(path, accuracy="hgh")  # wrong
sm.analyse(path, lwa="linear")  # wrong
sm.load(path, acuracy="best")  # wrong
run.lwa  # wrong
sm.Scene(bob_mas_kg=0.2)  # wrong
"""


@pytest.mark.trials
def test_mypy_finds_every_mistake_and_no_other(tmp_path: Path) -> None:
    """Names, arguments, options and choices, under ``mypy --strict``."""
    pytest.importorskip("mypy")
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(script)], cwd=ROOT, capture_output=True, text=True, timeout=600
    )
    found = {int(line) for line in re.findall(r"script\.py:(\d+): error", done.stdout)}
    wrong = {number for number, line in enumerate(SCRIPT.splitlines(), 1) if line.endswith("# wrong")}
    assert found == wrong, done.stdout + done.stderr


@pytest.mark.parametrize(("keywords", "options"), [(ReadKeywords, LoadOptions), (AnalysisKeywords, AnalysisOptions)])
def test_a_checker_of_types_knows_every_option(keywords: type, options: type[LoadOptions]) -> None:
    """A checker reads only a list written out, so the two lists must agree."""
    assert keywords.__annotations__.keys() == {each.name for each in fields(options)}


CODE = """
import sys
import numpy as np
import springmass as sm
t = np.arange(1000) / 100
y = 0.2 + 0.05 * np.cos(8.3 * t) + 1e-4 * np.random.default_rng(1).standard_normal(1000)
run = sm.analyse((t, y))
assert abs(run["angular_frequency"].value - 8.3) < 0.01, run
print(*sorted({name.partition(".")[0] for name in sys.modules}))
from springmass.cli import main
main(["analyse", str(sm.sample_data() / "undamped_simulated_position.txt"), "-o", sys.argv[1]])
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


def test_only_what_is_of_use_is_imported(tmp_path: Path) -> None:
    """Cyclopts takes a tenth of the time of the imports of an analysis, and matplotlib longer than a whole report."""
    command = [sys.executable, "-c", CODE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    analysis, *_, report = (line.split() for line in done.stdout.splitlines())
    assert "numpy" in analysis
    assert "cyclopts" not in analysis
    assert "cyclopts" in report
    assert "matplotlib" not in report
