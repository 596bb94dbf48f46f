"""Colours, dashes and markers of data, selected, other and rejected laws, flagged samples, marks and order in time."""

from __future__ import annotations

import json
from typing import Any

LOOKS: dict[str, dict[str, Any]] = {
    "data": {"light": ["#0063a0"], "dark": ["#6cb8f0"], "dash": [[]], "marker": "dot"},
    "law": {"light": ["#1d232a"], "dark": ["#e4e8ec"], "dash": [[]], "marker": "dot"},
    "other": {
        "light": ["#00704f", "#a03f78", "#7d5f00", "#2a6f97", "#5b3cc4", "#9c3a1c", "#4a6b00", "#4d4d4d"],
        "dark": ["#4fd1a5", "#e8a0c8", "#f0c04a", "#9ad5f5", "#b9a5ff", "#ff9f80", "#b5d96b", "#c9c9c9"],
        "dash": [[8, 4], [2, 3], [10, 3, 2, 3], [4, 2, 4, 6]],
        "marker": "ring",
    },
    "rest": {"light": ["#5f6b76"], "dark": ["#a3adb8"], "dash": [[1, 3]], "marker": "dot"},
    "flagged": {"light": ["#b84a00"], "dark": ["#ff9d5c"], "dash": [[]], "marker": "cross"},
    "band": {"light": ["#0063a0"], "dark": ["#6cb8f0"], "dash": [[]], "marker": "dot", "opacity": [0.2, 0.4]},
    "time": {
        "light": ["#440154", "#3f4a8a", "#2d6e8e", "#1f7f79", "#2f7d32", "#6b7300", "#8f6400", "#a84e00"],
        "dark": ["#fde725", "#c2df23", "#86d549", "#52c569", "#2ab07f", "#3aa6b9", "#74a4e6", "#b79cf0"],
        "dash": [[]],
        "marker": "dot",
    },
    "mark": {"light": ["#a03f78"], "dark": ["#e8a0c8"], "dash": [[4, 4]], "marker": "ring"},
}
"""Colours on a light and on a dark background, dashes and marker of each role; a role with several takes them in turn.

``opacity`` is that of a filled band, a quarter where it is not given.

Every colour has a contrast of at least 4.5 to 1 on its background, and roles differ by dashes or markers as well.
"""


def looks_script() -> str:
    """Return the table as the script that charts.js needs before it."""
    return f"const LOOKS = {json.dumps(LOOKS, separators=(',', ':'))};\n"
