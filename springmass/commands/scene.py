"""``springmass scene``: a scene to fill in, a scene checked, and what is noted beside a recording afterwards."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from acquisition.errors import visible
from springmass.commands.options import FileArgument, converted
from springmass.commands.parameters import argument, option
from springmass.errors import HINT, LOG, OK, ProgramError

SCENE_TEMPLATE = """\
# What was at the bench. Remove the # before what you measured, and put your numbers for the dots.
# { value = ..., u = ... } states a standard uncertainty; a plain number counts as exact. What is not known is not used.

[bob]
# mass_kg = { value = ..., u = ... }        # kg, such as 0.2007 and 0.0001: all that hangs on the spring, disc included

[spring]
# mass_kg = { value = ..., u = ... }        # kg, such as 0.0104 and 0.0001: a third of it swings along
# constant_n_per_m = ...                    # for springmass simulate; an analysis measures it

[pendulum]
# length_m = { value = ..., u = ... }       # m, from the pivot to the middle of the bob: its angle gives g

[disc]
# diameter_m = { value = ..., u = ... }     # m, such as 0.102 and 0.0005

[air]
# temperature_c = { value = ..., u = ... }  # degrees C: it sets the speed of sound, the scale of a rangefinder
# pressure_pa = ...                         # 101325 if it is not stated
# relative_humidity = ...                   # 0 to 1, 0.5 if it is not stated

[sensor]
# position = "below"                        # of a rangefinder: "below" or "above" the bob
# mean_samples = ...                        # it gives the mean of its last so many distances
# lag_s = { value = ..., u = ... }          # s, or it follows with a first-order lag

# For springmass simulate and record --simulate; an analysis measures these:
# [start]
# displacement_m = ...                      # m, such as 0.05
# [damping]                                 # dA/dt = -(mu + gamma A + beta A^2)
# gamma_per_s = ...                         # such as 0.0073
# beta_per_m_s = ...                        # such as 0.235
# mu_m_per_s = ...
"""


def _mark(text: str) -> tuple[float, str]:
    seconds, equals, words = text.partition("=")
    try:
        moment = float(seconds)
    except ValueError:
        equals = ""
    if not equals or not words.strip() or not abs(moment) < float("inf"):
        raise ValueError("must be SECONDS=TEXT")
    return moment, words.strip()


def scene(
    recording: Annotated[
        FileArgument | None, argument("RECORDING", "save scene, remarks and marks next to this recording")
    ] = None,
    /,
    *,
    check: Annotated[
        FileArgument | None, option("FILE", "show what a scene file states and which values are unusual")
    ] = None,
    scene: Annotated[FileArgument | None, option("FILE", "scene file to use with the recording from now on")] = None,
    note: Annotated[tuple[str, ...], option("TEXT", "a remark; may be repeated")] = (),
    mark: Annotated[
        tuple[tuple[float, str], ...],
        converted("S=TEXT", "a mark S seconds into the recording; may be repeated", _mark),
    ] = (),
) -> int:
    """Print the template, check a scene, or note scene, remarks and marks beside a recording."""
    from pipeline.bench.scene import Scene
    from springmass.commands.questions import quoted
    from springmass.loading.notes import about_of, write_about
    from springmass.loading.scenes import ask_about, read_scene, stated_keys

    noted = scene is not None or note or mark
    if check is not None:
        if recording is not None or noted:
            raise ProgramError("--check looks at a scene file alone; leave the rest out")
        checked = read_scene(check)
        ask_about(checked, check)
        print(visible(f"{check}: a scene that states {stated_keys(checked)}"))
        if checked == Scene():
            LOG.log(HINT, f"write what you measured into {check}, and remove the # before it")
            return OK
        LOG.log(HINT, f"springmass analyse RECORDING --scene {shlex.quote(str(check))}")
        return OK
    if recording is None:
        if noted:
            raise ProgramError("--scene, --note and --mark belong to a recording; name it")
        print(SCENE_TEMPLATE, end="")
        LOG.log(HINT, "springmass scene > bench.toml, fill it in, springmass scene --check bench.toml")
        return OK
    if not noted:
        demand = "nothing to save; give --scene, --note or --mark S=TEXT"
        raise ProgramError(
            f"{recording}: {demand}, or check a scene: springmass scene --check {quoted(str(recording))}"
        )
    path = Path(recording)
    if not path.is_file():
        raise ProgramError(f"{path}: expected a recording, got none; check the name")
    given = None if scene is None else read_scene(scene)
    written = write_about(about_of(path).with_more(given, note, mark))
    LOG.info(f"{written}: used from now on with {path.name}")
    LOG.log(HINT, f"springmass analyse {shlex.quote(str(path))}")
    return OK
