"""The NIST reference sets as a fixture."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def nist() -> ModuleType:
    """Return ``nist_models.py``: models, numbers and the count of digits that agree."""
    path = Path(__file__).with_name("nist_models.py")
    spec = importlib.util.spec_from_file_location("springmass_tests_nist_models", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
