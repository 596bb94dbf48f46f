"""What other packages add by entry points: recordings' formats and sensors' families alike."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from acquisition.errors import AcquisitionError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["entry_points_of", "load_entry"]


@cache
def entry_points_of(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; looked for once a process."""
    from importlib.metadata import entry_points  # costs more than all the rest of the registries

    return {entry.name: entry for entry in entry_points(group=group)}


def load_entry(
    entry: EntryPoint, what: str, refused: type[AcquisitionError], checked: Callable[[Any], Any] = lambda found: found
) -> Any:
    """Return what an entry point names, as ``checked`` takes it.

    Raises
    ------
    refused
        If it cannot be loaded or is not what it should be, whatever is raised; one line.
    """
    try:
        return checked(entry.load())
    except Exception as error:
        reason = " ".join(str(error).split())
        raise refused(
            f"{what} ({entry.value}): cannot be loaded ({type(error).__name__}: {reason}); "
            "repair or remove the package that brings it"
        ) from error
