"""``springmass help``: what a command does."""

from __future__ import annotations

import argparse

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Print the help of the program, or of a command."""
    from springmass.cli import build_parser

    build_parser().parse_args([*([options.topic] if options.topic else []), "--help"])
    raise AssertionError("--help ends the program")
