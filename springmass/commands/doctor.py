"""``springmass doctor``: is this installation what it should be?"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from springmass.doctor import examine
from springmass.errors import OK, SOME_FAILED

__all__ = ["run"]


def run(options: argparse.Namespace) -> int:
    """Print every check; exit with 1 where one failed."""
    checks = examine()
    if options.json:
        print(json.dumps([asdict(check) for check in checks]))
    else:
        for check in checks:
            print(f"{'ok  ' if check.ok else 'FAIL'}  {check.name:<24} {check.found}")
            if not check.ok:
                print(f"      {check.remedy}")
    return OK if all(check.ok for check in checks) else SOME_FAILED
