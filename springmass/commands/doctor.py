"""``springmass doctor``: check the installation for problems that have broken such programs before."""

import importlib
import importlib.metadata
import importlib.util
import json
import platform
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from springmass.commands.options import Json
from springmass.errors import HINT, LOG, OK, SOME_FAILED, ProgramError
from springmass.layout import PACKAGES, PREFIX, part

MODULES = {"pyserial": "serial"}
"""The modules of libraries that have another name than their distribution."""
InstallationCheck = tuple[str, bool, str, str]
"""The name of a check, whether it is met, what was found, and what to do if it is not."""


def doctor(*, as_json: Json = False) -> int:
    """Print every check; exit with 1 where one failed."""
    from acquisition.errors import visible  # imported here because doctor checks for a foreign package of this name

    checks: list[InstallationCheck] = [*_packages(), *_libraries()]
    if whole := all(ok for _, ok, _, _ in checks):
        checks += [_bundled(), _round_trip()]  # these run the packages and libraries
        whole = all(ok for _, ok, _, _ in checks)
    if as_json:
        print(json.dumps([dict(zip(("name", "ok", "found", "remedy"), each, strict=True)) for each in checks]))
    for name, ok, state, remedy in () if as_json else checks:
        print(visible(f"{'ok  ' if ok else 'FAIL'}  {name:<24} {state}"))
        if not ok:
            print(visible(f"      {remedy}"))
    if whole:
        LOG.log(HINT, "springmass demo")
    return OK if whole else SOME_FAILED


def _packages() -> Iterator[InstallationCheck]:
    """Check Python, and that our packages are found and no others of these names, without running them.

    In a checkout they have names that other distributions use too; a wheel has them inside ``springmass``.
    """
    yield "python", sys.version_info >= (3, 11), platform.python_version(), "install Python 3.11 or newer"
    for name in PACKAGES:
        spec = importlib.util.find_spec(PREFIX + name)
        place = None if spec is None or spec.origin is None else Path(spec.origin).resolve().parent
        state = "nowhere" if spec is None else str(place or "a folder that is no package")
        remedy = "another distribution brings a package of this name: install springmass into a virtual environment"
        yield f"package {name}", place == part(name), state, remedy


def _libraries() -> Iterator[InstallationCheck]:
    """Check that each library that the distribution springmass requires can be imported."""
    remedy = "install springmass again: pip install --force-reinstall"
    try:
        required = importlib.metadata.requires("springmass") or ()
    except importlib.metadata.PackageNotFoundError:
        yield "libraries", False, "springmass itself is not installed", "install it: pip install -e CHECKOUT"
        return
    for name in (re.split(r"[^\w.-]", line)[0] for line in required if "extra ==" not in line):
        try:
            importlib.import_module(MODULES.get(name, name.lower().replace("-", "_")))
            state, ok = importlib.metadata.version(name), True
        except ImportError as error:
            state, ok = str(error), False
        yield f"library {name}", ok, state, remedy


def _bundled() -> InstallationCheck:
    from springmass.loading.load import sample_data

    try:
        return "bundled recordings", True, str(sample_data()), ""
    except ProgramError as error:
        return "bundled recordings", False, str(error), "install springmass again"


def _round_trip() -> InstallationCheck:
    """Write a run file and read it back: HDF5, its filters and the temporary folder in one."""
    import numpy as np

    from acquisition.block import Block, SourceInfo
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
        return "run file", False, str(error), "free the temporary folder, or install h5py again"
    return "run file", same, "written and read back" if same else "read back other values", "install h5py again"
