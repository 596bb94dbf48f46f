"""``springmass scene``: a scene to fill in, a scene checked, and what is noted beside a recording afterwards."""

import shlex
from pathlib import Path
from typing import Annotated

from acquisition.errors import visible
from springmass.commands.options import FileArgument, FileArguments, converted
from springmass.commands.parameters import argument, option
from springmass.errors import HINT, LOG, OK, UNREADABLE, ProgramError, of_several
from springmass.loading.inputs import files_of
from springmass.loading.options import LoadOptions


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
    *recordings: Annotated[
        FileArgument, argument("RECORDING", "save scene, remarks, marks and how it is read next to each, or a folder's")
    ],
    check: Annotated[
        FileArgument | None, option("FILE", "show what a scene file states and which values are unusual")
    ] = None,
    scene: Annotated[FileArgument | None, option("FILE", "scene file to use with the recording from now on")] = None,
    note: Annotated[tuple[str, ...], option("TEXT", "a remark; may be repeated")] = (),
    mark: Annotated[
        tuple[tuple[float, str], ...],
        converted("S=TEXT", "a mark S seconds into the recording; may be repeated", _mark),
    ] = (),
    read: FileArguments = FileArguments(),
) -> int:
    """Print the template, check a scene, or note scene, remarks and marks beside a recording."""
    from acquisition.errors import AcquisitionError, NeedsAnswer
    from pipeline.bench.scene import Scene
    from springmass.commands.questions import for_one, quoted
    from springmass.loading.load import load
    from springmass.loading.notes import about_of, keep_answers, write_about
    from springmass.loading.scenes import ask_about, read_scene, stated_keys
    from storage.errors import StorageError

    answers = read.given()
    noted = scene is not None or note or mark or answers
    if check is not None:
        if recordings or noted:
            raise ProgramError("--check looks at a scene file alone", "leave the rest out")
        checked = read_scene(check)
        ask_about(checked, check)
        print(visible(f"{check}: a scene that states {stated_keys(checked)}"))
        todo = f"write what you measured into {check}, and remove the # before it"
        LOG.log(HINT, todo if checked == Scene() else f"springmass analyse RECORDING --scene {shlex.quote(check)}")
        return OK
    if not recordings:
        if noted:
            raise ProgramError("--scene, --note, --mark and options of reading belong to a recording", "name it")
        print(Path(__file__).with_name("scene_template.toml").read_text("utf-8"), end="")
        LOG.log(HINT, "springmass scene > bench.toml, fill it in, springmass scene --check bench.toml")
        return OK
    if not noted:
        remedy = "give --scene, --note, --mark S=TEXT or an option of reading"
        check = f"springmass scene --check {quoted(recordings[0])}"
        raise ProgramError(f"{recordings[0]}: nothing to save", f"{remedy}, or check a scene: {check}")
    files, messages = files_of(recordings)
    for line in messages:
        LOG.info(line)
    stated = None if scene is None else read_scene(scene)

    def save(path: Path, velocity: str | None) -> None:
        if not path.is_file():
            raise ProgramError(f"{path}: expected a recording, got none", "check the name")
        if answers:
            loaded = load(path, LoadOptions(**({"velocity": velocity} | answers)))
            keep_answers(path, answers, loaded.sha256)
        about = about_of(path)
        if stated is not None or note or mark:
            write_about(about.with_more(stated, note, mark))
        LOG.info(f"{about.path}: used from now on with {path.name}")

    codes = []
    for each in files:
        try:
            save(Path(each.path), each.velocity)
            codes.append(OK)
        except (ProgramError, AcquisitionError, StorageError) as error:
            if len(files) == 1:
                raise
            LOG.warning(for_one(error, "scene", each.path, answers) if isinstance(error, NeedsAnswer) else error)
            codes.append(error.exit_code if isinstance(error, ProgramError) else UNREADABLE)
    if OK in codes:
        LOG.log(HINT, f"springmass analyse {shlex.join(recordings)}")
    return of_several(codes)
