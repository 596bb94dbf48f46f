"""The LaTeX that the commands write: every template and table compiles, and no line is too wide."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.conftest import Cli
from tests.cli.test_compare_cli import BARE, DATA, DISC, DISC_SCENE, RIGHT

CLIPPED = str(DATA / "clipped_simulated_position.txt")
CALLS = {
    "a pair": ("compare", *RIGHT, "--template", "latex"),
    "a run": ("analyse", DISC, "--scene", DISC_SCENE, "--template", "latex", "--method", "classic"),
    "without a scene": ("analyse", CLIPPED, "--template", "latex", "--law", "power"),
    "three runs": ("analyse", BARE, DISC, CLIPPED),
}


@pytest.mark.trials
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX; Debian: apt-get install texlive-science")
@pytest.mark.parametrize("name", CALLS)
def test_latex_compiles_every_template_and_table(tmp_path: Path, cli: Cli, name: str) -> None:
    """No line is too wide, neither in a report nor in the text width of article; each cited figure is there."""
    assert cli(*CALLS[name], "-o", tmp_path / "out").code == 0
    (table,) = (tmp_path / "out").rglob("table.tex")
    tables = table.with_name("tables.tex")
    packages = r"\documentclass{article}\usepackage{booktabs,longtable,siunitx}\begin{document}"
    tables.write_text(rf"{packages}\input{{table.tex}}\input{{budget.tex}}\end{{document}}")
    report = table.with_name("lab-report.tex")
    assert report.exists() == ("--template" in CALLS[name])
    for document in (tables, *[report] * report.exists()):
        call = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", document.name]
        for _ in range(2):
            done = subprocess.run(call, cwd=tables.parent, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
        assert [line for line in done.stdout.splitlines() if "Overfull" in line or "undefined" in line] == []
