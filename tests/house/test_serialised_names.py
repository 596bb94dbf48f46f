"""What the program writes keeps its names: keys, codes, attributes, columns and messages."""

from __future__ import annotations

from pathlib import Path

from tests.house.serialised_names import collected, listed


def test_no_serialised_name_disappears_and_new_ones_are_listed(tmp_path: Path) -> None:
    """The names that commands, files and messages use are those of ``serialised_names.txt``, section by section."""
    expected, found = listed(), collected(tmp_path)
    gone = {section: sorted(names - found.get(section, set())) for section, names in expected.items()}
    new = {section: sorted(names - expected.get(section, set())) for section, names in found.items()}
    assert {section: names for section, names in gone.items() if names} == {}, "restore these names"
    assert {section: names for section, names in new.items() if names} == {}, (
        "add these names: python -m tests.house.serialised_names --update"
    )
