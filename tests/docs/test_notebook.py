"""The notebook of the documentation runs from its first cell to its last, and is stored with what it shows."""

from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "tutorial.ipynb"


def shown_by(notebook: Any) -> list[tuple[str, str]]:
    """Return what the cells show, as pairs of a kind and a text."""
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", ())]
    assert [each for each in outputs if each.output_type == "error" or each.get("name") == "stderr"] == []
    printed = [("printed", each.text) for each in outputs if each.output_type == "stream"]
    return printed + [(kind, text) for each in outputs for kind, text in each.get("data", {}).items()]


@pytest.mark.trials
def test_the_notebook_runs_and_shows_what_is_stored_in_it() -> None:
    """A new kernel runs each task without an error, and shows the results that the stored notebook shows."""
    import nbclient
    import nbformat

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    stored = shown_by(notebook)
    where = {"metadata": {"path": str(NOTEBOOK.parent)}}
    executed = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources=where).execute()
    for shown in (stored, shown_by(executed)):
        for kind, words in (
            ("text/html", "springmass-analysis"),
            ("text/html", "dataframe"),
            ("image/png", ""),
            ("text/plain", "14.00"),
            ("printed", "True 14.00"),
            ("printed", "incompatible type \"Literal['slow']\""),
            ("printed", "accuracy must be one of"),
        ):
            assert any(words in text for found, text in shown if found == kind), words
