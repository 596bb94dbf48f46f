"""A hunt guided by coverage: atheris grows inputs from sound ones towards code not yet reached."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

_SCRIPT = """
import importlib, sys
import atheris
with atheris.instrument_imports(include=[{package!r}]):
    {imports}
atheris.Setup([sys.argv[0], *sys.argv[2:]], importlib.import_module(sys.argv[1]).target)
atheris.Fuzz()
"""


def hunt(
    module: str,
    package: str,
    imports: str,
    seeds: Mapping[str, bytes],
    folder: Path,
    *,
    runs: int,
    seconds: int,
    longest: int,
    options: Sequence[str] = (),
) -> int:
    """Run a hunt over the ``target`` of a test module in a separate process; return how many inputs it tried.

    Parameters
    ----------
    module : str
        Name of the test module.
    package : str
        What is watched while it runs.
    imports : str
        What imports that package's modules.
    seeds : mapping of str to bytes
        Sound inputs, by name.
    folder : Path
        Where seeds and finds are kept.
    runs, seconds, longest : int
        Inputs to try, seconds after which it ends, and bytes of the longest input.
    options : sequence of str
        More of libFuzzer's.
    """
    for name, data in seeds.items():
        (folder / name).write_bytes(data)
    bounds = [f"-runs={runs}", f"-max_total_time={seconds}", "-seed=1", f"-max_len={longest}", *options]
    script = _SCRIPT.format(package=package, imports=imports)
    command = [sys.executable, "-c", script, module, *bounds, f"-artifact_prefix={folder}/", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600 + 10 * seconds)
    assert done.returncode == 0, done.stderr[-3000:]
    tried = re.search(r"Done (\d+) runs", done.stderr)
    assert tried, done.stderr[-3000:]
    return int(tried[1])
