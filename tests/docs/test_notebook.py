"""The notebook of the documentation runs from its first cell to its last."""

from __future__ import annotations

from pathlib import Path

import nbclient
import nbformat
import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "tutorial.ipynb"


@pytest.mark.trials
def test_the_notebook_runs_and_shows_what_it_says() -> None:
    """A new kernel shows summaries and frames as HTML, figures as pictures, and the true spring constant."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    where = {"metadata": {"path": str(NOTEBOOK.parent)}}
    executed = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources=where).execute()
    shown = [each for cell in executed.cells for each in cell.get("outputs", ())]
    data = [(kind, text) for each in shown for kind, text in each.get("data", {}).items()]
    for kind, words in (("text/html", "springmass-analysis"), ("text/html", "dataframe"), ("text/plain", "14.00")):
        assert any(words in text for found, text in data if found == kind), words
    assert [kind for kind, _ in data].count("image/png") == 1
    assert [each for each in shown if each.output_type == "error" or each.get("name") == "stderr"] == []
