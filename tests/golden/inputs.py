"""The files that the command lines of the goldens read: shared recordings, and files made from seeded generators.

In a command line ``{recordings}`` stands for the shared recordings, ``{sample}`` for sample_data, ``{here}`` for this
folder, ``{fresh}`` for an empty folder, and ``{copies}`` for one with copies of two sample recordings.
``{troubles}/NAME.csv`` is the record of a kind of trouble, ``{motions}/NAME.csv`` a closed form of this module,
``{odd}/NAME`` a file that must be refused or questioned, and ``{damaged}/N.wire`` a damaged copy of base.wire. These
four are made when a command line names them.
"""

import random
import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import tomli_w

from tests.synthetic import F8, LAW_TRUTHS, Truth, solved, times
from tests.trials.troubles.kinds import KINDS
from tests.trials.troubles.record import Kind

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RECORDINGS = ROOT.parent / "shared" / "recordings"
COPIED = ("damped_simulated_position.txt", "undamped_simulated_position.txt")
COURSE = ("clipped", "cropped", "sixty_hz", "undamped")


class Places:
    """The folders that the braces of command lines stand for, and the files in them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def filled(self, words: list[str], fresh: Path) -> list[str]:
        """Return a command line with its files in place; ``fresh`` is a folder of its own."""
        for word in words:
            for room, name in re.findall(r"\{(troubles|motions|odd|damaged)\}/([^ ]+)", word):
                path = self.folder / room / name
                if not path.exists():
                    path.parent.mkdir(parents=True, exist_ok=True)
                    _MAKERS[room](path)
        if any("{copies}" in word for word in words):
            (fresh / "copies").mkdir()
            for name in COPIED:
                shutil.copy(ROOT / "sample_data" / name, fresh / "copies")
        if any("{course}" in word for word in words):
            _course(fresh / "course")
        folders = {"recordings": RECORDINGS, "sample": ROOT / "sample_data", "here": HERE, "fresh": fresh}
        folders |= {name: fresh / name for name in ("copies", "course")}
        folders |= {name: self.folder / name for name in _MAKERS}
        return [re.sub(r"\{(\w+)\}", lambda match: str(folders[match[1]]), word) for word in words]


def missing(words: list[str]) -> bool:
    """Say whether a command line needs the shared recordings where there are none."""
    return any("{recordings}" in word for word in words) and not RECORDINGS.is_dir()


# Troubles


@cache
def _kinds() -> dict[str, Kind]:
    return {trouble_name(kind.name): kind for kind in KINDS}


def trouble_name(name: str) -> str:
    """Return the file name of a kind of trouble without its suffix: words and hyphens."""
    return re.sub(r"[^a-z0-9.]+", "-", name.lower().replace("%", "percent")).strip("-.")


def _trouble(path: Path) -> None:
    """Write the record of a kind of trouble as text, and its scene next to it."""
    of_scene = path.name.endswith(".scene.toml")
    name = path.name.removesuffix(".scene.toml") if of_scene else path.stem
    # An odd seed draws mixed drag: no record of one law alone.
    record = _kinds()[name].make(1)
    if of_scene:
        path.write_text(tomli_w.dumps(record.scene), "utf-8")
    elif record.text is not None:
        path.write_bytes(record.text)
    else:
        _write(path, record.t, record.y, "distance (m)")


def _write(path: Path, t: F8, y: F8, heading: str) -> None:
    rows = "".join(f"{at:.6f},{'' if np.isnan(value) else f'{value:.7f}'}\n" for at, value in zip(t, y, strict=True))
    path.write_text(f"time (s),{heading}\n{rows}", "utf-8")


# Motions in closed form


def _noise(size: int, sigma: float) -> F8:
    return sigma * np.random.default_rng(7).standard_normal(size)


def _swing(t: F8, amplitude: float, omega: float = 8.3, gamma: float = 0.01) -> F8:
    """Return a damped cosine; its derivatives are taken as if it were not damped, which 1 % of noise hides."""
    return amplitude * np.exp(-gamma * t) * np.cos(omega * t + 0.4)


def _pendulum(t: F8) -> F8:
    """Return the angle of a pendulum of 1 m from 0.9 rad, rad."""
    return solved(lambda _, x, v: -9.81 * np.sin(x) - 0.02 * v, 0.9, t)[0]


def _saturating(t: F8) -> F8:
    """Return an angle whose frequency falls with the amplitude up to 0.05 rad, and no further beyond."""
    amplitude = 0.15 * np.exp(-0.025 * t)
    return amplitude * np.cos(np.cumsum(7.7 * (1.0 - 0.017 * np.minimum(amplitude / 0.05, 1.0))) / 100.0)


_MOTIONS: dict[str, tuple[str, float, Callable[[F8], F8]]] = {
    "velocity": ("velocity (m/s)", 0.002, lambda t: _swing(t, 0.4)),
    "acceleration": ("acceleration (m/s2)", 0.02, lambda t: _swing(t, 3.4)),
    "angle": ("angle (rad)", 0.002, lambda t: _swing(t, 0.3, 4.0)),
    "angular-velocity": ("angular velocity (rad/s)", 0.01, lambda t: _swing(t, 1.2, 4.0)),
    "force": ("force (N)", 0.004, lambda t: _swing(t, 0.8)),
    "voltage": ("voltage (V)", 0.004, lambda t: 1.0 + _swing(t, 0.8)),
    "pendulum": ("angle (rad)", 0.002, _pendulum),
    "still": ("distance (m)", 3e-4, lambda t: np.full_like(t, 0.3)),
    "relaxation": ("distance (m)", 3e-4, lambda t: 0.3 + 0.08 * np.exp(-1.3 * t) - 0.03 * np.exp(-6.0 * t)),
    "strongly-damped": ("distance (m)", 3e-4, lambda t: 0.3 + _swing(t, 0.08, 8.0, 2.0)),
    "two-modes": ("distance (m)", 3e-4, lambda t: 0.3 + _swing(t, 0.03, 7.0) + _swing(t, 0.025, 9.1)),
    "three-halves": ("distance (m)", 3e-4, Truth(**LAW_TRUTHS["power"]).position),
    "stops": ("distance (m)", 3e-4, Truth(gamma=0.02, mu=1.6e-3).position),
    "short": ("distance (m)", 3e-4, lambda t: 0.3 + _swing(t, 0.05)),
    "saturating": ("angle (rad)", 3e-4, _saturating),
    "cubic-drag": ("distance (m)", 2e-5, lambda t: 0.3 + solved(lambda _, x, v: -68.9 * x - 4.0 * v**3, 0.1, t)[0]),
    "wavering": ("distance (m)", 3e-4, lambda t: 0.3 + (0.05 - 2e-4 * t + 5e-3 * np.sin(0.2 * t)) * np.cos(8.3 * t)),
    "switch": ("voltage (V)", 0.01, lambda t: np.where(t % 2.0 < 1.0, 1.0, 0.0)),
}
_SECONDS = {"short": 2.0, "stops": 45.0, "saturating": 100.0}
_SECONDS |= dict.fromkeys(("three-halves", "pendulum", "wavering", "switch"), 60.0)


def _motion(path: Path) -> None:
    heading, sigma, motion = _MOTIONS[path.stem]
    t = times(_SECONDS.get(path.stem, 20.0))
    _write(path, t, motion(t) + _noise(t.size, sigma), heading)


# Files that must be refused or questioned


def _table(head: str, form: str = "{:.2f},{:.3f}") -> str:
    t = times(10.0)
    rows = [form.format(at, value) for at, value in zip(t, 22.0 + _swing(t, 4.0) + _noise(t.size, 0.01), strict=True)]
    return "\n".join([*([head] if head else []), *rows, ""])


def _rewritten(head: str, row: Callable[[int, float, str], str]) -> str:
    rows = (each.split(",") for each in _table("").splitlines())
    return "\n".join([head, *(row(i, float(t), x) for i, (t, x) in enumerate(rows)), ""])


def _only_values(head: str) -> str:
    return "\n".join([head, *(row.partition(",")[2] for row in _table("").splitlines())])


_ODD: dict[str, Callable[[], str | bytes]] = {
    "empty.txt": lambda: "",
    "bytes.txt": lambda: bytes(range(256)) * 40,
    "picture.txt": lambda: b"\x89PNG\r\n\x1a\n" + bytes(3000),
    "blank.txt": lambda: b" \r\n\r\n",
    "broken.h5": lambda: b"\x89HDF\r\n\x1a\n" + bytes(300),
    "broken.wire": lambda: b"not a wire log" * 9,
    "film.txt": lambda: b"\0\0\0\x20ftypisom" + bytes(99),
    "title.txt": lambda: "Motion Sensor Data File Mar 12, 2024 2:05 PM",
    "diary.txt": lambda: "Dear diary,\r\ntoday we hung a mass.\r\n",
    "one-line.txt": lambda: "0.01\t25.3 " * 2000,
    "no-unit.csv": lambda: _table("time (s),height"),
    "no-names.csv": lambda: _table(""),
    "no-time.csv": lambda: _only_values("height (cm)"),
    "no-time-unit.csv": lambda: _table("t,height (cm)", "{:.0f},{:.3f}").replace("\n", "\n1", 1),
    "strange-unit.csv": lambda: _table("time (s),height (furlong)"),
    "two-channels.csv": lambda: "\n".join(
        f"{row},{row.rpartition(',')[2]}" if at else "time (s),left (cm),right (cm)"
        for at, row in enumerate(_table("x").splitlines())
    ),
    "two-runs.csv": lambda: (
        "Run 1: Time (s),Run 1: x (m),Run 2: Time (s),Run 2: x (m)\n"
        + "".join(",".join(2 * [f"{0.01 * i:.2f},{0.2 + 0.05 * np.cos(0.083 * i):.4f}"]) + "\n" for i in range(500))
    ),
    "two-times.csv": lambda: (
        "clock (s),lamp (s),height (cm)\n"
        + "".join(f"{0.01 * i:.2f},{0.0107 * i:.4f},{20 + 4 * np.cos(0.083 * i):.3f}\n" for i in range(500))
    ),
    "constant.csv": lambda: "time (s),height (cm)\n" + "".join(f"{0.01 * i:.2f},22.5\n" for i in range(500)),
    "three-rows.csv": lambda: "time (s),height (cm)\n0.00,22.1\n0.01,22.3\n0.02,22.2\n",
    "row-numbers.csv": lambda: _rewritten(
        "seq_num,time,ranger,setpoint", lambda i, t, x: f"{i},{1.7e9 + t:.2f},{x},0.0"
    ),
    "days.csv": lambda: _rewritten("Time,Distance (cm)", lambda _, t, x: f"{0.6096 + t / 86400.0:.12f},{x}"),
    "no-mass.toml": lambda: "[bob]\nmass_kg = -0.2\n",
    "unknown-key.toml": lambda: "[bob]\nmas_kg = 0.2\n",
    "not.toml": lambda: "[bob\n",
    "stiff.toml": lambda: '[bob]\nmass_kg = 0.2\n[spring]\nconstant_n_per_m = "fourteen"\n',
    "heavy.toml": lambda: "[bob]\nmass_kg = 217.6\n",
    "soft.toml": lambda: (
        "[bob]\nmass_kg = 0.2\n[start]\ndisplacement_m = 0.05\n"
        "[spring]\nconstant_n_per_m = 20\ncubic_n_per_m3 = -9000\n"
    ),
    "no-spring.toml": lambda: "[bob]\nmass_kg = 0.2\n",
    "reported.csv": lambda: (
        "run,name,value,u,unit\ndamped_simulated_position,T,0.79,0.01,s\n"
        "undamped_simulated_position,T,0.790066,0.00002,s\ndamped_simulated_position,k,14.0,0.1,N/m\n"
        "damped_simulated_position,T,0.9,0.001,s\ndamped_simulated_position,colour,3,,\n"
    ),
    "hooke.csv": lambda: (
        "mass_kg,rest_m\n" + "".join(f"{mass},{0.20 + 9.81 * mass / 14.0:.4f}\n" for mass in (0.1, 0.15, 0.2, 0.25))
    ),
    "not-reported.csv": lambda: "run,value\nx,1\n",
}


def _odd(path: Path) -> None:
    content = _ODD[path.name]()
    path.write_bytes(content if isinstance(content, bytes) else content.encode())


# Damaged logs


def _damaged(path: Path) -> None:
    """Flip bits, cut, zero, repeat or truncate base.wire, in up to four places."""
    seed = int(path.stem)
    draw, spoiled = random.Random(seed), bytearray((HERE / "base.wire").read_bytes())
    kind = seed % 5
    for _ in range(1 + seed // 5 % 4):
        at, count = draw.randrange(len(spoiled)), draw.choice((1, 7, 64, 700, 5000))
        if kind == 0:
            spoiled[at] ^= 1 << draw.randrange(8)
        elif kind == 1:
            del spoiled[at : at + count]
        elif kind == 2:
            spoiled[at : at + count] = bytes(min(count, len(spoiled) - at))
        elif kind == 3:
            spoiled[at:at] = spoiled[at : at + count]
        else:
            del spoiled[max(at, len(spoiled) // 8) :]
    path.write_bytes(spoiled)


# A course


def _course(folder: Path) -> None:
    """Make a course of eight runs: four bundled recordings, two modes, a relaxation, a bob at rest and velocities."""
    folder.mkdir()
    for name in COURSE:
        shutil.copy(ROOT / "sample_data" / f"{name}_simulated_position.txt", folder)
    for name in ("two-modes", "relaxation", "still", "velocity"):
        _motion(folder / f"{name}.csv")


_MAKERS: dict[str, Callable[[Path], None]] = {
    "troubles": _trouble,
    "motions": _motion,
    "odd": _odd,
    "damaged": _damaged,
}
