"""``springmass doctor``: an installation that is whole passes, and a package of another distribution is found."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Cli


def test_this_installation_is_whole(cli: Cli) -> None:
    """Every check passes, and both ways to print them say so."""
    done = cli("doctor")
    assert (done.code, done.err) == (0, "")
    assert {line[:4] for line in done.out.splitlines()} == {"ok  "}
    (checks,) = cli("doctor", "--json").results
    assert len(checks) > 5
    assert all(check["ok"] for check in checks)


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the program with a folder first on the path."""
    code = f"import sys; sys.path.insert(0, {str(folder)!r}); from springmass.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Return a folder with a package called storage that is not ours and must not be run."""
    package = tmp_path / "storage"
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError('the storage of someone else')\n")
    return tmp_path


def test_a_foreign_package_is_found(foreign: Path) -> None:
    """The check fails by name, says where it lies and runs nothing of it; every other command sends to the doctor."""
    done = python(foreign, "doctor")
    assert (done.returncode, done.stderr) == (1, "")
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("FAIL"))
    assert line.split()[:3] == ["FAIL", "package", "storage"]
    assert str((foreign / "storage").resolve()) in line
    (foreign / "storage" / "__init__.py").write_text("")
    other = python(foreign, "analyse", "--json", "run.txt")
    assert (other.returncode, other.stdout) == (1, "")
    (line,) = other.stderr.splitlines()
    assert "springmass doctor" in line


def test_a_missing_library_is_found(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is named, and no check runs that needs it."""
    monkeypatch.setitem(sys.modules, "h5py", None)
    done = cli("doctor")
    assert (done.code, done.err) == (1, "")
    assert "FAIL  library h5py" in done.out
