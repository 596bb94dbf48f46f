"""Load what other packages add through entry points: formats, sensors, damping laws and integrators."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import TYPE_CHECKING, Any

from failure import Error

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@cache
def entry_points_of(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; the result is cached for the process."""
    from importlib.metadata import entry_points  # importing it takes longer than all other code of the registries

    return {entry.name: entry for entry in entry_points(group=group)}


def names_in(group: str, built_in: Iterable[str]) -> tuple[str, ...]:
    """Return the names of what is built in, then of what other packages add to a group."""
    return tuple(dict.fromkeys((*built_in, *entry_points_of(group))))


def load_entry(
    entry: EntryPoint, what: str, refused: type[Error], checked: Callable[[Any], Any] = lambda loaded: loaded
) -> Any:
    """Load an entry point and return what ``checked`` makes of it; any exception becomes a ``refused`` of one line."""
    try:
        return checked(entry.load())
    except Exception as error:
        reason = " ".join(str(error).split())
        raise refused(
            f"{what} ({entry.value}): cannot be loaded ({type(error).__name__}: {reason})",
            "repair or remove the package that provides it",
        ) from error


def load_named(group: str, name: str, kind: type[Any], refused: type[Error]) -> Any:
    """Load what another package adds to a group under a name, alone or in a table by name; it must be of a kind."""

    def checked(loaded: Any) -> Any:
        loaded = loaded.get(name) if isinstance(loaded, dict) else loaded
        if not isinstance(loaded, kind) or loaded.name != name:
            raise refused(f"expected {kind.__name__} of the name {name!r}, got {loaded!r:.80}")
        return loaded

    return load_entry(entry_points_of(group)[name], f"{kind.__name__.lower()} {name!r}", refused, checked)
