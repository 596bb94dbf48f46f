"""``springmass doctor``: check the installation for problems that have broken such programs before."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import json
import platform
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from springmass.commands.options import Json
from springmass.errors import OK, SOME_FAILED, suggest
from springmass.layout import PACKAGES, PREFIX, part

LIBRARIES = (
    *("numpy", "scipy", "threadpoolctl", "h5py", "xarray", "h5netcdf", "uncertainties", "matplotlib", "jinja2"),
    *(
        "serial",
        "nptdms",
        "python_calamine",
        "rich",
        "cyclopts",
        "tomli_w",
        "platformdirs",
        "starlette",
        "uvicorn",
        "websockets",
    ),
    "segno",
    "msgspec",
)
DISTRIBUTIONS = {"serial": "pyserial"}


@dataclass(frozen=True, slots=True)
class Check:
    """One check.

    Parameters
    ----------
    name : str
    ok : bool
    found : str
        What was seen.
    remedy : str
        What to do where it is not ok.
    """

    name: str
    ok: bool
    found: str
    remedy: str = ""


def doctor(*, as_json: Json = False) -> int:
    """Print every check; exit with 1 where one failed."""
    from acquisition.errors import visible  # imported here because doctor checks for a foreign package of this name

    checks = examine()
    if as_json:
        print(json.dumps([asdict(check) for check in checks]))
    else:
        for check in checks:
            print(visible(f"{'ok  ' if check.ok else 'FAIL'}  {check.name:<24} {check.found}"))
            if not check.ok:
                print(visible(f"      {check.remedy}"))
    if all(check.ok for check in checks):
        suggest("springmass demo")
    return OK if all(check.ok for check in checks) else SOME_FAILED


def examine() -> tuple[Check, ...]:
    """Run every check."""
    checks = (*_interpreter(), *_packages(), *_libraries())
    if not all(check.ok for check in checks):
        return checks  # the remaining checks run these packages and libraries
    return (*checks, _bundled(), _round_trip())


def foreign_packages() -> dict[str, str]:
    """Return packages that are not those of this program, name to where they were found.

    In a checkout ``acquisition``, ``pipeline`` and ``storage`` are imported by these names, which other distributions
    use too; one found first on the path would be run in place of ours. A wheel has them inside ``springmass``.
    """
    foreign: dict[str, str] = {}
    for name in PACKAGES:
        spec = importlib.util.find_spec(PREFIX + name)  # finds the package without running it
        place = None if spec is None or spec.origin is None else Path(spec.origin).resolve().parent
        if place != part(name):
            foreign[name] = "nowhere" if spec is None else str(place or "a folder that is no package")
    return foreign


def _interpreter() -> Iterator[Check]:
    version = platform.python_version()
    yield Check("python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")
    own = sys.prefix != sys.base_prefix
    found = sys.prefix if own else "no virtual environment"
    # Not a failure: without a virtual environment, all works until another distribution uses one of our package names.
    yield Check("environment", True, found)


def _packages() -> Iterator[Check]:
    foreign = foreign_packages()
    for name in PACKAGES:
        found = foreign.get(name, str(part(name)))
        yield Check(
            f"package {name}",
            name not in foreign,
            found,
            "another distribution brings a package of this name: install springmass into a virtual environment",
        )


def _libraries() -> Iterator[Check]:
    for name in LIBRARIES:
        try:
            importlib.import_module(name)
            yield Check(f"library {name}", True, importlib.metadata.version(DISTRIBUTIONS.get(name, name)))
        except ImportError as error:
            yield Check(f"library {name}", False, str(error), "install springmass again: pip install --force-reinstall")


def _bundled() -> Check:
    from springmass.errors import ProgramError
    from springmass.runs.loading import sample_data

    try:
        return Check("bundled recordings", True, str(sample_data()))
    except ProgramError as error:
        return Check("bundled recordings", False, str(error), "install springmass again")


def _round_trip() -> Check:
    """Write a run file and read it back: HDF5, its filters and the temporary folder in one."""
    import numpy as np

    from acquisition.block import Block
    from acquisition.source import SourceInfo
    from storage.errors import StorageError
    from storage.run_file.reading import open_run
    from storage.run_file.writing import write_run

    block = Block(0, np.arange(8) / 100.0, np.linspace(0.2, 0.3, 8), np.zeros(8, np.uint8))
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = write_run(Path(folder) / "check.h5", [block], SourceInfo("simulated", "doctor", 100.0))
            with open_run(path) as run:
                same = bool(np.array_equal(run.samples().distance, block.distance))
    except (StorageError, OSError) as error:
        return Check("run file", False, str(error), "free the temporary folder, or install h5py again")
    return Check("run file", same, "written and read back" if same else "read back other values", "install h5py again")
