"""The options that a command line states: a call refuses those for which it has no use, so that none is dropped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from cyclopts import Parameter
from cyclopts.argument import Argument

from springmass.errors import ProgramError


@dataclass(frozen=True, slots=True)
class Given:
    """The options that were typed, each by its longest name."""

    options: tuple[str, ...]

    @classmethod
    def of(cls, arguments: Iterable[Argument], words: Sequence[str]) -> Given:
        """Return the options among the words of a command line, given the arguments that its command declares."""
        longest = {name: max(each.names, key=len) for each in arguments for name in each.names}
        end = words.index("--") if "--" in words else len(words)
        typed = (word.partition("=")[0] if word.startswith("--") else word[:2] for word in words[:end])
        return cls(tuple(dict.fromkeys(longest[name] for name in typed if name[:1] == "-" and name in longest)))

    def refuse(self, use: str, *names: str) -> None:
        """Refuse options for which a use of the command has no use."""
        if unused := [name for name in self.options if name in names]:
            raise ProgramError(f"{', '.join(unused)}: no effect {use}", "leave it out")

    def only(self, use: str, *names: str) -> None:
        """Refuse all options but those for which a use of the command has a use."""
        self.refuse(use, *(name for name in self.options if name not in names))


GivenOptions: TypeAlias = Annotated[Given, Parameter(parse=False)]
"""The parameter with which a command asks for the options that were typed."""
