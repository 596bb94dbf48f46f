"""Where the real recordings are, which are never part of the project."""

from pathlib import Path

import pytest

REPO_ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return the folder of real recordings; the test is skipped where it is absent."""
    folder = REPO_ROOT.parent / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip("needs ../shared/recordings")
    return folder
