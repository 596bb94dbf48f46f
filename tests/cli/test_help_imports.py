"""``springmass --help`` answers quickly: it imports no library of numbers, files, pictures or pages."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import springmass
from springmass.command_line import COMMANDS

HEAVY = {
    "numpy",
    "scipy",
    "h5py",
    "xarray",
    "matplotlib",
    "pandas",
    "jinja2",
    "starlette",
    "uvicorn",
}

DECLARED_NEGATIVE = {"--no-report", "--no-browser", "--no-trace", "--no-probe"}
"""Options of ours; the library adds none for flags that have no opposite."""

# What the interpreter imports at its start, such as for the environment's own hooks, is not the program's doing.
CODE = """
import sys
before = set(sys.modules)
from springmass.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
print(*(set(sys.modules) - before), file=sys.stderr)
"""


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["analyse", "--help"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    """Neither numpy nor h5py, nor what needs them."""
    done = subprocess.run([sys.executable, "-c", CODE, *arguments], capture_output=True, text=True, check=True)
    imported = set(done.stderr.split())
    assert imported & HEAVY == set()
    assert "springmass.cli" in imported
    assert done.stdout


@pytest.mark.parametrize("accuracy", ["fast", "standard", "best"])
@pytest.mark.parametrize("name", ["damped", "undamped"])
def test_an_analysis_imports_no_slow_library(data: Path, accuracy: str, name: str) -> None:
    """On the way to JSON no pandas, scipy.signal or scipy.stats, 0.2 to 0.5 s each, nor what a report needs."""
    command = ["analyse", "--json", "--accuracy", accuracy, str(data / f"{name}_simulated_position.txt")]
    done = subprocess.run([sys.executable, "-c", CODE, *command], capture_output=True, text=True, check=True)
    imported = set(done.stderr.split())
    assert (
        imported & {"pandas", "scipy.signal", "scipy.stats", "matplotlib", "jinja2", "h5py", "xarray", "lmfit", "rich"}
        == set()
    )
    assert "pipeline.analyse" in imported


def test_importing_the_package_imports_nothing_heavy() -> None:
    """``import springmass`` is free; its names are loaded when they are used."""
    code = "import sys; before = set(sys.modules); import springmass; print(*(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) & HEAVY == set()


def test_help_names_every_command_and_the_exit_codes(cli: Callable[..., Any]) -> None:
    """What the program can do and how it says that it failed."""
    done = cli("--help")
    assert (done.code, done.err) == (0, "")
    assert {line.split()[0] for line in done.out.splitlines() if line.startswith(" ") and line.strip()} >= {*COMMANDS}
    assert "3 unreadable input" in " ".join(done.out.split())


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_has_help(cli: Callable[..., Any], command: str) -> None:
    """Each explains itself."""
    done = cli(command, "--help")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith(f"springmass {command}")
    assert {word for word in done.out.split() if word.startswith("--no-")} <= DECLARED_NEGATIVE
    assert "--empty-" not in done.out


@pytest.mark.parametrize("columns", ["20", "200", "wide"])
def test_help_fits_any_terminal(cli: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, columns: str) -> None:
    """A width that is absurd or no number is no reason to fail."""
    monkeypatch.setenv("COLUMNS", columns)
    assert cli("analyse", "--help").code == 0


def test_the_version_is_the_packages(cli: Callable[..., Any]) -> None:
    """One line with the name."""
    assert cli("--version").out == f"springmass {springmass.__version__}\n"


@pytest.mark.parametrize("arguments", [[], ["no-such-command"]])
def test_no_command_is_a_usage_error(cli: Callable[..., Any], arguments: list[str]) -> None:
    """Exit code 2 and what there is."""
    done = cli(*arguments)
    assert (done.code, done.out) == (2, "")
    assert "springmass --help" in done.complaint


def test_a_name_that_the_package_lacks_is_told() -> None:
    """The error lists what there is, and dir() too."""
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'; it has LAWS, Analysis"):
        _ = springmass.nonsense  # type: ignore[attr-defined]
    assert {"load", "analyse", "open_run", "write_run"} <= set(dir(springmass))
    assert all(getattr(springmass, name) is not None for name in springmass.__all__)
