"""Draw the rooms of the program, and of which other packages each imports something: `make docs-figures`.

The rooms stand in the order of the import contracts in `pyproject.toml`, each above those from which it may import;
rooms without a gap between them are one layer. A dot is an import of another package, wider for more names.
"""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
WIDTH, PAD, BOX, GAP = 1000, 10, 22, 6
COLUMNS = {"springmass": (10, 320), "pipeline": (340, 320), "storage": (670, 320), "acquisition": (670, 320)}
COLOURS = {"springmass": "#33415c", "pipeline": "#0063a0", "storage": "#00704f", "acquisition": "#b84a00"}
WHAT = {
    "springmass": "the program and the library",
    "springmass.cli": "runs a command, prints its error",
    "springmass.commands": "one module a command",
    "springmass.api": "what import springmass has",
    "springmass.course": "hundreds of runs, one table",
    "springmass.page": "a recording in the browser",
    "springmass.terminal": "tables, colours, keys",
    "springmass.report": "page, tables, LaTeX",
    "springmass.session": "records from open ports",
    "springmass.simulations": "the motion of a scene",
    "springmass.comparing": "runs of one spring",
    "springmass.runs": "a recording and its analysis",
    "springmass.result": "Table 1, JSON, budgets, advice",
    "springmass.loading": "files, arrays, scenes, options",
    "springmass.charts": "charts as data, their colours",
    "springmass.typeset": "numbers and units as text",
    "springmass.stops": "Ctrl-C and other ends",
    "springmass.errors": "exit codes",
    "springmass.layout": "where the parts are",
    "pipeline": "arithmetic, no files",
    "pipeline.analyse": "calls the stages in order",
    "pipeline.analysis": "the result of an analysis",
    "pipeline.findings": "codes and their words",
    "pipeline.options": "fast, standard, best",
    "pipeline.results": "numbers with uncertainties",
    "pipeline.checks": "what residuals show",
    "pipeline.motion": "the fit of the motion",
    "pipeline.several": "runs compared, joint laws",
    "pipeline.simulation": "integrators, bands of a scene",
    "pipeline.dynamics": "the equation of motion",
    "pipeline.damping": "laws and their choice",
    "pipeline.parts": "what swings freely",
    "pipeline.modes": "other oscillations",
    "pipeline.windows": "amplitude and phase a period",
    "pipeline.samples": "false echoes, clipped crests",
    "pipeline.bench": "masses, disc, air, sensor",
    "pipeline.numerics": "least squares, statistics",
    "pipeline.quantities": "names of results",
    "pipeline.track": "times, distances, flags",
    "pipeline.units": "nouns and units of values",
    "pipeline.notice": "what a stage reports",
    "pipeline.errors": "its exceptions",
    "storage": "files on disk",
    "storage.recovery": "a run file from a log",
    "storage.run_file": "HDF5, written whole",
    "storage.wire_log": "every byte of a sensor",
    "storage.recorder": "its thread that writes",
    "acquisition": "bytes to samples",
    "acquisition.live": "ports and their times",
    "acquisition.simulated": "a sensor without hardware",
    "acquisition.replay": "a recording as a sensor",
    "acquisition.recordings": "files of other programs",
    "acquisition.decoders": "one family a sensor",
    "acquisition.block": "samples in a row",
    "acquisition.clock": "the only use of time",
}
ORDER = {
    "storage": [["recovery"], ["run_file"], ["wire_log", "recorder"]],
    "acquisition": [["live", "simulated"], ["replay", "recordings"], ["decoders"], ["block", "clock"]],
}
"""Packages whose rooms no contract orders."""


@dataclass(frozen=True)
class Room:
    """A folder or a module of a package, and its height in the drawing."""

    package: str
    name: str
    y: float


def layers(package: str) -> list[list[str]]:
    """Return the rooms of a package from the highest to the lowest; those of a row do not depend on each other."""
    if package in ORDER:
        return ORDER[package]
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    for contract in contracts:
        rows = [[name.strip() for name in row.replace("|", ":").split(":")] for row in contract.get("layers", ())]
        if (
            rows
            and "containers" not in contract
            and all(name.startswith(f"{package}.") for row in rows for name in row)
        ):
            return [[name.partition(".")[2] for name in row] for row in rows]
    raise ValueError(f"no contract in pyproject.toml orders the rooms of {package}")


def placed() -> tuple[list[Room], dict[str, tuple[float, float]]]:
    """Return the rooms, and top and height of each package."""
    rooms, frames = list[Room](), dict[str, tuple[float, float]]()
    bottom = dict.fromkeys((x for x, _ in COLUMNS.values()), 8.0)
    for package, (x, _) in COLUMNS.items():
        top = y = bottom[x]
        y += 36
        for row in layers(package):
            for name in row:
                rooms.append(Room(package, name, y))
                y += BOX
            y += GAP
        frames[package] = (top, y - top + PAD - GAP)
        bottom[x] = y + 2 * PAD
    return rooms, frames


def imports(path: Path) -> set[str]:
    """Return the modules that a module imports when it is imported or one of its functions runs."""
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for each in node.orelse:
                visit(each)
            return
        if isinstance(node, ast.Import):
            found.update(name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{name.name}" for name in node.names)
        for each in ast.iter_child_nodes(node):
            visit(each)

    visit(ast.parse(path.read_text("utf-8")))
    return found


def outside(room: Room) -> Counter[str]:
    """Return how many names of each other package the room imports."""
    base = ROOT / room.package / room.name
    paths = sorted(base.rglob("*.py")) if base.is_dir() else [base.with_suffix(".py")]
    found = Counter[str]()
    for name in set[str]().union(*map(imports, paths)):
        package = name.partition(".")[0]
        if package in COLUMNS and package != room.package:
            found[package] += 1
    return found


def drawn(room: Room) -> str:
    """Return the box of a room with its dots."""
    x, width = COLUMNS[room.package]
    dots, at = "", x + width - PAD - 12
    for package in reversed(COLUMNS):
        if count := outside(room)[package]:
            dots += (
                f'<circle cx="{at}" cy="{room.y + BOX / 2:.0f}" r="{2.5 + min(count, 30) / 10:.1f}" '
                f'fill="{COLOURS[package]}"><title>{count} names of {package}</title></circle>'
            )
            at -= 14
    return (
        f'<rect x="{x + PAD}" y="{room.y:.0f}" width="{width - 2 * PAD}" height="{BOX}" fill="white" '
        f'stroke="{COLOURS[room.package]}" stroke-opacity="0.5"/><text x="{x + PAD + 8}" y="{room.y + 15.5:.1f}">'
        f'<tspan class="room">{room.name}</tspan> <tspan class="what" dx="4">'
        f"{WHAT[f'{room.package}.{room.name}']}</tspan></text>{dots}"
    )


def drawing() -> str:
    """Return the SVG."""
    rooms, frames = placed()
    parts = []
    for package, (top, height) in frames.items():
        x, width = COLUMNS[package]
        parts.append(
            f'<rect x="{x}" y="{top:.0f}" width="{width}" height="{height:.0f}" rx="8" fill="#f6f7f9" '
            f'stroke="{COLOURS[package]}"/><text x="{x + PAD}" y="{top + 24:.0f}"><tspan class="package" '
            f'fill="{COLOURS[package]}">{package}</tspan><tspan dx="8" class="what">{WHAT[package]}</tspan></text>'
        )
    parts += map(drawn, rooms)
    x, y = COLUMNS["acquisition"][0] + PAD, sum(frames["acquisition"]) + 30
    for package in list(COLUMNS)[1:]:
        parts.append(
            f'<circle cx="{x + 6}" cy="{y}" r="4" fill="{COLOURS[package]}"/><text x="{x + 18}" y="{y + 4.5}" '
            f'class="what">imports something of {package}</text>'
        )
        y += 20
    height = max(top + height for top, height in frames.values()) + 8
    style = (
        "text{font:13px sans-serif;fill:#222}.room{font-weight:600}.package{font-weight:bold;font-size:16px}"
        ".what{fill:#555;font-size:12px}"
    )
    title = "The rooms of the program in the order of their imports; dots show the other packages that a room imports"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" width="{WIDTH}" '
        f'height="{height:.0f}" role="img"><title>{title}</title><style>{style}</style>'
        f'<rect width="{WIDTH}" height="{height:.0f}" fill="white"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def main(folder: Path = HERE) -> Path:
    """Write the drawing into a folder and return its file."""
    target = folder / "rooms.svg"
    target.write_text(drawing(), encoding="utf-8")
    return target


if __name__ == "__main__":
    main()
