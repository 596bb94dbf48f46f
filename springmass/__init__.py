"""springmass: from a rangefinder's samples to period, spring constant and damping law.

Examples
--------
>>> import springmass
>>> loaded = springmass.load(springmass.sample_data() / "undamped_simulated_position.txt")
>>> analysis = springmass.analyse(loaded.track)
>>> print(analysis.estimates["period"])
0.758517 +- 0.000022 s
"""

from __future__ import annotations

# Type checkers take the name for true; importing typing for it would cost `springmass --help` milliseconds.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from acquisition.replay import Replay
    from pipeline.analyse import Analysis, analyse
    from pipeline.classic import classic
    from pipeline.compare import SpringRun, compare_springs
    from pipeline.estimate import Estimate
    from pipeline.scene import Scene
    from pipeline.track import Track
    from springmass.loading import Loaded, load, read_scene, sample_data
    from storage.run import open_run
    from storage.write import write_run

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
    "Estimate": "pipeline.estimate",
    "Loaded": "springmass.loading",
    "Replay": "acquisition.replay",
    "Scene": "pipeline.scene",
    "SpringRun": "pipeline.compare",
    "Track": "pipeline.track",
    "analyse": "pipeline.analyse",
    "classic": "pipeline.classic",
    "compare_springs": "pipeline.compare",
    "load": "springmass.loading",
    "open_run": "storage.run",
    "read_scene": "springmass.loading",
    "sample_data": "springmass.loading",
    "write_run": "storage.write",
}


def __getattr__(name: str) -> Any:
    import importlib

    if name not in _WHERE:
        raise AttributeError(f"module 'springmass' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
