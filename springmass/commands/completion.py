"""``springmass completion``: what a shell needs to complete commands and options."""

from __future__ import annotations

import argparse

from springmass.errors import OK

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Print the completion script of a shell."""
    import shtab

    from springmass.cli import build_parser

    print(shtab.complete(build_parser(), options.shell))
    return OK
