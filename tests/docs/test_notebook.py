"""The notebook of the documentation runs from its first cell to its last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbclient
import nbformat
import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "tutorial.ipynb"


@pytest.fixture(scope="module")
def executed() -> Any:
    """Return the notebook, executed by a new kernel in the folder of the documentation."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    client = nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(NOTEBOOK.parent)}}
    )
    return client.execute()


def outputs(notebook: Any, kind: str) -> list[str]:
    """Return what cells showed in a form of MIME."""
    shown = [each for cell in notebook.cells for each in cell.get("outputs", ())]
    return [each["data"][kind] for each in shown if kind in each.get("data", {})]


@pytest.mark.trials
def test_the_notebook_runs_and_shows_what_it_says(executed: Any) -> None:
    """Summaries and frames as HTML, figures as pictures, and the true spring constant."""
    pages = outputs(executed, "text/html")
    assert any("springmass-analysis" in page for page in pages)
    assert any("dataframe" in page for page in pages)
    assert len(outputs(executed, "image/png")) == 1
    assert any("14.00" in text for text in outputs(executed, "text/plain"))
    errors = [each for cell in executed.cells for each in cell.get("outputs", ()) if each.output_type == "error"]
    assert errors == []
    warnings = [
        each.text for cell in executed.cells for each in cell.get("outputs", ()) if each.get("name") == "stderr"
    ]
    assert warnings == []


def test_the_notebook_is_kept_without_outputs() -> None:
    """What it shows is made anew by whoever runs it; differences in the repository are those of its text."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    assert all(not cell.get("outputs") and not cell.get("execution_count") for cell in notebook.cells)
