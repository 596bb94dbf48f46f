"""springmass: from a rangefinder's samples to period, spring constant and damping law.

The program combines acquisition, pipeline and storage. `cli` runs a command line, and `commands` do the work by means
of `runs`, `session` and `report`. Scripts may rely on the names exported here; everything else may move.

Examples
--------
>>> import springmass as sm
>>> run = sm.analyse(sm.sample_data() / "undamped_simulated_position.txt")
>>> run["period"]
0.758516(22) s
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from acquisition.decoders.sensor import Sensor
    from acquisition.recordings.recording import Format
    from pipeline.bench.scene import Scene
    from pipeline.damping.laws import LAWS
    from pipeline.damping.laws.of_function import make_law
    from springmass.api.analysing import analyse, compare, load
    from springmass.api.blocks import source
    from springmass.api.courses import batch, results
    from springmass.api.simulation import simulate
    from springmass.api.stream import Stream
    from springmass.errors import Error
    from springmass.loading.load import sample_data
    from springmass.runs.run import Run
else:
    # Imported on first use, so that `springmass --help` need not wait for numpy; a type checker sees the imports above.
    _WHERE = {
        "Error": "springmass.errors",
        "Format": "acquisition.recordings.recording",
        "LAWS": "pipeline.damping.laws",
        "Run": "springmass.runs.run",
        "Scene": "pipeline.bench.scene",
        "Sensor": "acquisition.decoders.sensor",
        "Stream": "springmass.api.stream",
        "analyse": "springmass.api.analysing",
        "batch": "springmass.api.courses",
        "compare": "springmass.api.analysing",
        "load": "springmass.api.analysing",
        "make_law": "pipeline.damping.laws.of_function",
        "results": "springmass.api.courses",
        "sample_data": "springmass.loading.load",
        "simulate": "springmass.api.simulation",
        "source": "springmass.api.blocks",
    }

    def __getattr__(name):
        import importlib

        if name not in _WHERE:
            raise AttributeError(f"module 'springmass' has no attribute {name!r}; it has {', '.join(__all__)}")
        return getattr(importlib.import_module(_WHERE[name]), name)

    def __dir__():
        return sorted(__all__)


__version__ = "0.4.0"

# fmt: off
__all__ = [
    "LAWS", "Error", "Format", "Run", "Scene", "Sensor", "Stream", "__version__", "analyse", "batch", "compare", "load",
    "make_law", "results", "sample_data", "simulate", "source",
]
# fmt: on
