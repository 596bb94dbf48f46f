"""``springmass demo``: the main job on the bundled recordings, from their files to Table 1."""

from __future__ import annotations

import argparse
from pathlib import Path

from acquisition.clock import VirtualClock
from acquisition.replay import Replay
from pipeline.analyse import Motion
from pipeline.compare import Comparison, SpringRun, compare_springs
from pipeline.errors import AnalysisError
from springmass.analysing import Analysed, analyse_loaded
from springmass.commands.convert import write_loaded
from springmass.errors import OK
from springmass.loading import load, read_scene, sample_data
from springmass.report.tables import findings_text, text_table
from springmass.report.write import ReportRun, write_report

__all__ = ["run"]

RUNS = ("undamped", "damped")


def run(options: argparse.Namespace) -> int:
    """Replay both recordings into run files, analyse and compare them, print Table 1, write the report."""
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    analysed = [_one(name, out) for name in RUNS]
    reports = [ReportRun(name, a.analysis, a.result["input"], a.classic) for name, a in zip(RUNS, analysed, strict=True)]
    comparison = _compare(analysed)
    print("Simulated recordings that come with springmass, as MotionSensor.vi would have written them.\n")
    print(text_table(reports))
    for name, one in zip(RUNS, analysed, strict=True):
        print(f"\n{name.capitalize()}:")
        print(findings_text(one.result["findings"]))
    print(f"\n{comparison.message}")
    report = write_report(
        out / "demo.results",
        reports,
        comparison=comparison,
        provenance=analysed[0].result["provenance"],
        results=[a.result for a in analysed],
    )
    print(f"\nReport: {report}")
    return OK


def _one(name: str, out: Path) -> Analysed:
    """From the old files through a replay into a run file, and from that to the analysis."""
    data = sample_data()
    old = load(data / f"{name}_simulated_position.txt", velocity=data / f"{name}_simulated_velocity.txt")
    scene = read_scene(data / f"{name}.scene.toml")
    path = out / f"{name}.h5"
    with Replay(old.samples_in_blocks(), VirtualClock(), info=old.info, speed=None) as source:
        write_loaded(path, old, source, scene=scene.to_mapping(), overwrite=True)
    return analyse_loaded(load(path), None, parameters={"command": "demo"})


def _compare(analysed: list[Analysed]) -> Comparison:
    runs = []
    for name, one in zip(RUNS, analysed, strict=True):
        motion = one.analysis.motion
        if not isinstance(motion, Motion) or motion.derived.effective_mass_kg is None:
            raise AnalysisError(f"{name}: a comparison needs an oscillation and a bob mass; the bundled scene gives both")
        runs.append(SpringRun(name, motion.derived.statistical["angular_frequency"], motion.derived.effective_mass_kg))
    return compare_springs(runs, u_clock=analysed[0].analysis.params.derive.u_clock_nominal)
