"""springmass: from a rangefinder's samples to period, spring constant and damping law.

The program puts acquisition, pipeline and storage together: `cli` takes a line apart, `commands` do the work by `runs`,
`session`, `report` and `trade`. These names are what scripts may rely on; everything else may move.

Examples
--------
>>> import springmass
>>> loaded = springmass.load(springmass.sample_data() / "undamped_simulated_position.txt")
>>> analysis = springmass.analyse(loaded.track)
>>> print(analysis.estimates["period"])
0.758516 +- 0.000022 s
"""

from __future__ import annotations

# Type checkers take the name for true; importing typing for it would cost `springmass --help` milliseconds.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from acquisition.replay import Replay
    from pipeline.analyse import Analysis, analyse
    from pipeline.bench.scene import Scene
    from pipeline.numerics.estimate import Estimate
    from pipeline.results.classic import classic
    from pipeline.results.compare import SpringRun, compare_springs
    from pipeline.track import Track
    from springmass.runs.loading import Loaded, load, sample_data
    from springmass.runs.scenes import read_scene
    from storage.run_file.reading import open_run
    from storage.run_file.writing import write_run

__version__ = "0.1.0"

__all__ = [
    "Analysis",
    "Estimate",
    "Loaded",
    "Replay",
    "Scene",
    "SpringRun",
    "Track",
    "__version__",
    "analyse",
    "classic",
    "compare_springs",
    "load",
    "open_run",
    "read_scene",
    "sample_data",
    "write_run",
]

# Name to module: loaded on first use, so that `springmass --help` waits for none of them.
_WHERE = {
    "Analysis": "pipeline.analyse",
    "Estimate": "pipeline.numerics.estimate",
    "Loaded": "springmass.runs.loading",
    "Replay": "acquisition.replay",
    "Scene": "pipeline.bench.scene",
    "SpringRun": "pipeline.results.compare",
    "Track": "pipeline.track",
    "analyse": "pipeline.analyse",
    "classic": "pipeline.results.classic",
    "compare_springs": "pipeline.results.compare",
    "load": "springmass.runs.loading",
    "open_run": "storage.run_file.reading",
    "read_scene": "springmass.runs.scenes",
    "sample_data": "springmass.runs.loading",
    "write_run": "storage.run_file.writing",
}


def __getattr__(name: str) -> Any:
    import importlib

    if name not in _WHERE:
        raise AttributeError(f"module 'springmass' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
