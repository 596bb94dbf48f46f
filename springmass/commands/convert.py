"""``springmass convert``: a recording into a run file or another program's form, or the original out of a run."""

import shlex
from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Annotated

from acquisition.recordings.writers import WRITERS
from springmass.commands.given import GivenOptions
from springmass.commands.options import FileArgument, Overwrite, ReadArguments
from springmass.commands.parameters import argument, option
from springmass.errors import HINT, LOG, OK, UNREADABLE, ProgramError
from springmass.loading.inputs import RUN_SUFFIXES
from springmass.loading.load import load
from springmass.loading.loaded import Loaded
from springmass.loading.save import save_run
from springmass.loading.scenes import read_scene
from springmass.result.output_names import numbered
from storage.atomic import write_whole


def convert(
    recording: Annotated[FileArgument, argument("IN", "recording, run file or wire log")],
    output: Annotated[
        FileArgument, argument("OUT", ".h5 (run file), .txt (pair) or .csv; or a folder to copy the original to")
    ],
    /,
    *,
    scene: Annotated[FileArgument | None, option("FILE", "scene file to store in the run file")] = None,
    overwrite: Overwrite = False,
    read: ReadArguments = ReadArguments(),
    given: GivenOptions,
) -> int:
    """Convert one input."""
    out = Path(output)
    if out.suffix.lower() not in RUN_SUFFIXES:
        given.refuse("on an output that is no run file", "--scene")
    given_scene = None if scene is None else read_scene(scene).to_mapping()
    loaded = load(recording, read)
    if out.suffix.lower() in RUN_SUFFIXES:
        written = save_run(out, loaded, scene=given_scene, overwrite=overwrite)
        LOG.info(f"{written}: {len(loaded.samples)} samples from {loaded.path}")
        LOG.log(HINT, f"springmass analyse {shlex.quote(str(written))}")
        return OK
    if not _holds(loaded, out):
        return _write_form(loaded, out, overwrite=overwrite)
    for path in _give_back(loaded, out, overwrite):
        LOG.info(f"{path}: the original inside {loaded.path}, bit for bit")
    return OK


def _holds(loaded: Loaded, out: Path) -> bool:
    """Whether the user asks for the original inside a run file: it has the suffix, or no format has it."""
    if loaded.format != "run":
        return False
    suffixes = {PurePath(each.name).suffix.lower() for each in loaded.originals}
    return out.is_dir() or out.suffix.lower() in suffixes or out.suffix.lower() not in WRITERS


def _write_form(loaded: Loaded, out: Path, *, overwrite: bool) -> int:
    """Write the samples in the format of the suffix."""
    writer = WRITERS.get(out.suffix.lower())
    if writer is None:
        raise ProgramError(
            f"{out}: the suffix says what to write, one of {', '.join((*RUN_SUFFIXES, *WRITERS))}",
            f"got {out.suffix or 'no suffix'}",
        )
    if loaded.samples.quantity != "length":
        raise ProgramError(
            f"{out}: this form holds a length in m, got {loaded.samples.quantity} in {loaded.samples.unit}",
            f"write a run file, one of {', '.join(RUN_SUFFIXES)}",
        )
    start_time = str(loaded.provenance.get("start_time", ""))
    written = writer(str(loaded.path), loaded.samples, loaded.info, loaded.title, start_time)
    stem = out.stem.removesuffix("_position")  # run_velocity.txt stands beside run.txt or run_position.txt
    targets = [out.with_name(f"{stem}{added}{out.suffix}") if added else out for added, _ in written.files]
    _demand_free(targets, overwrite)
    for target, (_, data) in zip(targets, written.files, strict=True):
        write_whole(target, data, overwrite=overwrite)
        LOG.info(f"{target}: {len(loaded.samples)} samples from {loaded.path}")
    for sentence in written.lost:
        LOG.info(f"{out}: {sentence}")
    return OK


def _demand_free(targets: Sequence[Path], overwrite: bool) -> None:
    """Check before the work, so that of a pair either both files are written or none."""
    for target in () if overwrite else targets:
        if target.exists():
            raise ProgramError(f"{target}: the file exists already", "choose another place or add --overwrite")


def _give_back(loaded: Loaded, out: Path, overwrite: bool) -> list[Path]:
    if not loaded.originals:
        raise ProgramError(
            f"{loaded.path}: no original file travels inside this run", "nothing to give back", UNREADABLE
        )
    if out.is_dir():
        # Names are external input, so only their last part is used for the path.
        inside = [PurePath(each.name) for each in loaded.originals]
        stems = numbered([each.stem for each in inside])
        targets = [out / f"{stem}{each.suffix}" for stem, each in zip(stems, inside, strict=True)]
    elif len(loaded.originals) == 1:
        targets = [out]
    else:
        names = ", ".join(o.name for o in loaded.originals)
        raise ProgramError(
            f"{out}: {len(loaded.originals)} originals travel inside ({names})", "name an existing folder"
        )
    _demand_free(targets, overwrite)
    return [
        write_whole(target, original.data, overwrite=overwrite)
        for target, original in zip(targets, loaded.originals, strict=True)
    ]
