"""``springmass demo``: the main job on the bundled recordings, from their files to Table 1."""

import sys
from pathlib import Path
from typing import Annotated

from springmass.commands.options import FileArgument
from springmass.commands.parameters import output
from springmass.comparing.comparison import compare_runs
from springmass.errors import HINT, LOG, OK
from springmass.loading.load import load, sample_data
from springmass.loading.options import LoadOptions
from springmass.loading.save import save_run
from springmass.loading.scenes import read_scene
from springmass.report.write import write_report
from springmass.result.output_names import make_folder
from springmass.runs.run import Run
from springmass.runs.tasks import Task, analysed_runs
from springmass.terminal.printing import findings_text, text_table
from springmass.terminal.style import style_of

BUNDLED_RUNS = ("undamped", "damped")


def demo(
    *, output: Annotated[FileArgument, output("DIR", "output folder (default: springmass-demo)")] = "springmass-demo"
) -> int:
    """Convert both recordings to run files, analyse and compare them, print Table 1, write the report."""
    out = make_folder(output)
    runs = [_one(name, out) for name in BUNDLED_RUNS]
    compared = compare_runs(runs)
    print("Simulated recordings that come with springmass, as MotionSensor.vi would have written them.\n")
    print(text_table(BUNDLED_RUNS, [a.analysis for a in runs], style_of(sys.stdout)))
    for run in runs:
        print(f"\n{run.name.capitalize()}:")
        print(findings_text(run.result["findings"]))
    print(f"\n{compared.comparison.message}")
    print(f"\nReport: {write_report(out / 'demo.results', runs, compared=compared)}")
    LOG.log(
        HINT, "springmass analyse YOUR_RECORDING --scene BENCH.toml; springmass scene prints such a file to fill in"
    )
    return OK


def _one(name: str, out: Path) -> Run:
    """Convert the old files to a run file, and analyse that run file."""
    data = sample_data()
    velocity = data / f"{name}_simulated_velocity.txt"
    old = load(data / f"{name}_simulated_position.txt", LoadOptions(velocity=velocity))
    scene = read_scene(data / f"{name}.scene.toml").to_mapping()
    path = save_run(out / f"{name}.h5", old, scene=scene, overwrite=True)
    (run,) = analysed_runs([Task(str(path), name)])
    return run
