"""Write a run file of a recording that was loaded, with the origin and the time that every run file states."""

import os
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition.block import Block
from springmass import __version__
from springmass.loading.loaded import Loaded
from storage.run_file.writing import write_run


def made_now() -> dict[str, str]:
    """Return the origin that a run file states: program, version and time of creation."""
    return {"software": "springmass", "version": __version__, "created_utc": now_utc()}


def now_utc() -> str:
    """Return the current time in ISO 8601, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _answers(loaded: Loaded) -> dict[str, Any]:
    """Return what was stated about the file, with the name of a velocity file, whose bytes travel inside."""
    stated = dict(loaded.reading)
    if "velocity" in stated:
        stated["velocity"] = Path(stated["velocity"]).name
    return {"reading": stated} if stated else {}


def save_run(
    path: str | os.PathLike[str],
    loaded: Loaded,
    *,
    blocks: Iterable[Block] | None = None,
    scene: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a run file of an input with everything it states, its own bytes inside; ``blocks`` replace its samples."""
    return write_run(
        path,
        [loaded.samples] if blocks is None else blocks,
        loaded.info,
        originals=loaded.originals,
        scene=scene if scene is not None else loaded.scene,
        title=loaded.title,
        channel=loaded.channel,
        traps=loaded.traps,
        malformed_rows=loaded.recording.malformed_rows,
        format=loaded.recording.format,
        provenance={**loaded.provenance, **_answers(loaded), **made_now()},
        overwrite=overwrite,
    )
