"""Random scenes with reference trajectories of 80 bits: `python tests/reference/scenes.py` writes scenes.json here.

Made once and stored, by ``long_double.c``, which needs a C compiler and a ``long double`` of 64 bits of mantissa. It
shares nothing with the integrators, and agrees with the 40 digits of ``dynamics.json``; ``--compare`` says how far.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
STORED = HERE / "scenes.json"
SCENES = 200
ROWS = 40
MOST_STEPS = 400_000
NAMES = ("angular_frequency_per_s", "gamma_per_s", "drag_per_m", "friction_m_per_s2", "cubic_per_m2_s2")
KINDS = ("light", "mixed", "friction", "over", "critical", "stiff", "hardening", "softening", "pushed", "zero")


def main() -> None:
    """Solve every scene and store it, or compare with the 40 digits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--compare", action="store_true", help="say how far dynamics.json is off; write nothing")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "long_double.so"
        source = HERE / "long_double.c"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
        solver = ctypes.CDLL(str(library))
        if options.compare:
            compare(solver)
            return
        found = []
        for seed in range(SCENES):
            found.append(solved(solver, scene(seed)))
            print(f"{seed + 1} of {SCENES}", end="\r", flush=True)
    lines = ",\n".join(json.dumps(each) for each in found)
    STORED.write_text(f'{{"scenes": [\n{lines}\n]}}\n')


def scene(seed: int) -> dict[str, Any]:
    """Return one scene: amplitudes of 1e-9 to 1e3 m, 1 to 1e6 periods, every kind of damping, at any start."""
    rng = np.random.default_rng((19, seed))

    def spread(low: float, high: float, share: float = 1.0) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high)))) if rng.random() < share else 0.0

    kind = KINDS[seed % len(KINDS)]
    w, size, periods = spread(0.1, 100.0), spread(1e-9, 1e3), spread(1.0, 1e6)
    angle = 0.0 if rng.random() < 0.3 else rng.uniform(0.0, 2.0 * math.pi)
    # Damping that lasts about as long as the run, or a thousandth of it, so that something is left to be wrong.
    rate = 1.0 / (2.0 * math.pi * periods)
    gamma, drag, friction, cubic = rate * spread(1e-2, 1e2, 0.7), rate * spread(1e-2, 1e3, 0.4), 0.0, 0.0
    if kind == "mixed":
        drag = rate * spread(1e-2, 1e3) + spread(1e-6, 1e-1, 0.5)
    elif kind == "friction":
        friction = min(0.9, rate * spread(1e-2, 1e3) + spread(1e-4, 0.5, 0.3))
    elif kind == "over":
        gamma, drag = spread(1.0, 100.0), 0.0
    elif kind == "critical":
        gamma = 1.0
    elif kind == "stiff":
        gamma, drag = (spread(1e2, 1e5), 0.0) if rng.random() < 0.5 else (gamma, spread(10.0, 1e4))
    elif kind in ("hardening", "softening"):
        cubic = spread(1e-4, 1e4) if kind == "hardening" else -spread(1e-4, 0.2)
        friction = rate * spread(1e-2, 1.0, 0.3)
    elif kind == "pushed":
        angle, drag, friction = 0.5 * math.pi, rate * spread(1e-2, 1e3, 0.7), rate * spread(1e-2, 1e2, 0.3)
    elif kind == "zero":
        which = seed // len(KINDS) % 3
        gamma, drag, friction, cubic = (0.0, 0.0, 0.0, 0.0) if which == 0 else (gamma, rate, 1e-3 * (which == 2), 0.01)
        size = 0.0 if which < 2 else size
    unit = size or 1.0
    numbers = [w, w * gamma, drag / unit, w * w * unit * friction, w * w * cubic / unit**2]
    seconds, count = 2.0 * math.pi * periods / w, int(spread(200.0, 4000.0))
    rows = np.unique(np.concatenate([np.linspace(1, count, ROWS - 10), count - np.arange(10)]).astype(int))
    return {
        "kind": kind,
        "equation": dict(zip(NAMES, numbers, strict=True)),
        "start": [size * math.cos(angle), size * w * math.sin(angle)],
        "spacing_s": seconds / count,
        "count": count,
        "rows": rows.tolist(),
        "tolerance": spread(1e-9, 1e-3),
    }


def solved(solver: Any, case: dict[str, Any]) -> dict[str, Any]:
    """Return a case with its states, to the digits of a double."""
    rows = np.array(case["rows"], np.int64)
    numbers = np.array(list(case["equation"].values()))
    y, v = np.empty(rows.size), np.empty(rows.size)
    double, long = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_long)
    solver.solve.restype = ctypes.c_long
    steps = solver.solve(
        numbers.ctypes.data_as(double),
        *(ctypes.c_double(each) for each in (*case["start"], case["spacing_s"])),
        rows.ctypes.data_as(long),
        ctypes.c_size_t(rows.size),
        ctypes.c_long(MOST_STEPS),
        y.ctypes.data_as(double),
        v.ctypes.data_as(double),
    )
    if steps < 0:  # a hard spring over a million of its weak periods: a tenth of them
        return solved(solver, {**case, "spacing_s": 0.1 * case["spacing_s"]})
    return {**case, "y": y.tolist(), "v": v.tolist()}


def compare(solver: Any) -> None:
    """Print by how much the stored 40 digits differ, over the amplitude."""
    stored = json.loads((HERE / "dynamics.json").read_text())
    for name, case in stored["cases"].items():
        start = [case["displacement_m"], case["velocity_m_per_s"]]
        given = {"equation": case["equation"], "start": start, "spacing_s": stored["step_s"], "rows": case["rows"]}
        found = np.array(solved(solver, given)["y"])
        apart = np.max(np.abs(found - np.array([float(each) for each in case["y"]]))) / abs(start[0])
        print(f"{name}: {apart:.1e}")


if __name__ == "__main__":
    main()
