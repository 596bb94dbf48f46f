"""springmass: from a rangefinder's samples to period, spring constant and damping law.

The program combines acquisition, pipeline and storage. `cli` runs a command line, and `commands` do the work by means
of `runs`, `session`, `report` and `trade`. Scripts may rely on the names exported here; everything else may move.

Examples
--------
>>> import springmass as sm
>>> a = sm.analyse(sm.sample_data() / "undamped_simulated_position.txt")
>>> a["period"]
0.758516(22) s
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from acquisition.replay import Replay
    from pipeline.bench.scene import Scene
    from pipeline.damping.laws import LAWS
    from pipeline.damping.laws.of_function import make_law
    from pipeline.numerics.estimate import Estimate
    from pipeline.options import Options
    from pipeline.results.classic import classic
    from pipeline.results.compare import SpringRun, compare_springs
    from pipeline.track import Track
    from springmass.api.analysis import Analysis
    from springmass.api.live import live
    from springmass.api.opening import Run, open_run
    from springmass.api.results import results
    from springmass.api.sources import Comparison, analyse, compare, load
    from springmass.runs.loading import Loaded, sample_data
    from springmass.runs.scenes import read_scene
    from storage.run_file.writing import write_run

__version__ = "0.2.0"

__all__ = [
    "LAWS",
    "Analysis",
    "Comparison",
    "Estimate",
    "Loaded",
    "Options",
    "Replay",
    "Run",
    "Scene",
    "SpringRun",
    "Track",
    "__version__",
    "analyse",
    "classic",
    "compare",
    "compare_springs",
    "live",
    "load",
    "make_law",
    "open_run",
    "read_scene",
    "results",
    "sample_data",
    "write_run",
]

# The module of each public name. It is imported on first use, so that `springmass --help` need not wait for it.
_WHERE = {
    "Analysis": "springmass.api.analysis",
    "Comparison": "springmass.api.sources",
    "Estimate": "pipeline.numerics.estimate",
    "LAWS": "pipeline.damping.laws",
    "Loaded": "springmass.runs.loading",
    "Options": "pipeline.options",
    "Replay": "acquisition.replay",
    "Run": "springmass.api.opening",
    "Scene": "pipeline.bench.scene",
    "SpringRun": "pipeline.results.compare",
    "Track": "pipeline.track",
    "analyse": "springmass.api.sources",
    "classic": "pipeline.results.classic",
    "compare": "springmass.api.sources",
    "compare_springs": "pipeline.results.compare",
    "live": "springmass.api.live",
    "load": "springmass.api.sources",
    "make_law": "pipeline.damping.laws.of_function",
    "open_run": "springmass.api.opening",
    "read_scene": "springmass.runs.scenes",
    "results": "springmass.api.results",
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
