"""Reference trajectories to 40 digits: `python tests/reference/dynamics.py` writes dynamics.json beside itself.

Made once and stored. It shares nothing with the integrators: 60-digit decimals of the standard library, a Taylor series
of fixed order between turning points of the velocity, those found by Newton's method; critically damped and overdamped
linear motion by its closed form. Run with another number of digits it says by how much the two differ.
"""

from __future__ import annotations

import argparse
import json
from decimal import Decimal, getcontext
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
STORED = HERE / "dynamics.json"
ORDER = 40
PARTS = Decimal("0.4")  # radians a step at most


W = 8.66
STEP = 0.01  # s; the double, not the decimal
LONG = [
    1,
    2,
    3,
    7,
    18,
    36,
    37,
    73,
    181,
    363,
    700,
    1000,
    1451,
    2222,
    3333,
    4321,
    5000,
    6000,
    7001,
    8128,
    9000,
    9999,
    11000,
    11963,
    11999,
    12000,
]
SHORT = [1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 120, 144, 180, 233, 290, 300]
MIXED = {"gamma": 0.0073, "drag": 0.0639}

# name: coefficients of y'' = -w^2 y - 2 gamma y' - drag |y'| y' - friction sign(y') - cubic y^3, start, kept steps
CASES: dict[str, dict[str, Any]] = {
    "undamped": {"rows": LONG},
    "linear": {"gamma": 0.0073, "rows": LONG},
    "pushed": {"gamma": 0.05, "v": 0.3, "y": -0.01, "rows": LONG},
    "heavily damped": {"gamma": 4.0, "rows": SHORT},
    "critical": {"gamma": W, "rows": SHORT},
    "nearly critical": {"gamma": W * (1 + 2.0**-30), "rows": SHORT},
    "overdamped": {"gamma": 20.0, "v": 0.3, "rows": SHORT},
    "a thousand times overdamped": {"gamma": 8660.0, "rows": SHORT},
    "quadratic": {"drag": 0.0639, "rows": LONG},
    "mixed": {**MIXED, "rows": LONG},
    "mixed, strong": {"gamma": 0.5, "drag": 5.0, "rows": SHORT},
    "friction to the stop": {"friction": 0.5, "rows": SHORT},
    "mixed and friction": {**MIXED, "friction": 0.002, "rows": LONG},
    "hardening": {**MIXED, "cubic": 900.0, "rows": LONG},
    "softening": {**MIXED, "cubic": -900.0, "rows": LONG},
    "everything": {**MIXED, "friction": 0.001, "cubic": 900.0, "v": -0.2, "rows": LONG},
}


def main() -> None:
    """Compute every case and store it, or compare with what is stored."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--digits", type=int, default=60)
    parser.add_argument("--compare", action="store_true", help="say how far the stored values are off; write nothing")
    options = parser.parse_args()
    getcontext().prec = options.digits
    found = {name: case(**given) for name, given in CASES.items()}
    if options.compare:
        stored = json.loads(STORED.read_text())["cases"]
        for name, now in found.items():
            apart = max(abs(Decimal(a) - Decimal(b)) for a, b in zip(now["y"], stored[name]["y"], strict=True))
            print(f"{name}: {apart:.1e} m")
        return
    STORED.write_text(json.dumps({"step_s": STEP, "cases": found}, indent=1) + "\n")


def case(
    rows: list[int],
    *,
    y: float = 0.05,
    v: float = 0.0,
    gamma: float = 0.0,
    drag: float = 0.0,
    friction: float = 0.0,
    cubic: float = 0.0,
) -> dict[str, Any]:
    """Return one case as stored: coefficients as the doubles they are, states as decimals."""
    numbers = [Decimal(x) for x in (W, gamma, drag, friction, cubic)]
    times = [Decimal(STEP) * row for row in rows]
    start = (Decimal(y), Decimal(v))
    plain = not (drag or friction or cubic)
    states = closed(numbers, start, times) if plain and gamma >= W else series(numbers, start, times)
    return {
        "equation": {
            "angular_frequency_per_s": W,
            "gamma_per_s": gamma,
            "drag_per_m": drag,
            "friction_m_per_s2": friction,
            "cubic_per_m2_s2": cubic,
        },
        "displacement_m": y,
        "velocity_m_per_s": v,
        "rows": rows,
        "y": [f"{a:.39e}" for a, _ in states],
        "v": [f"{b:.39e}" for _, b in states],
    }


def closed(
    numbers: list[Decimal], start: tuple[Decimal, Decimal], times: list[Decimal]
) -> list[tuple[Decimal, Decimal]]:
    """Return the states of a critically damped or overdamped linear motion."""
    w, gamma = numbers[:2]
    y, v = start
    root = (gamma * gamma - w * w).sqrt()
    states = []
    for t in times:
        if root == 0:
            fall = (-gamma * t).exp()
            states.append((fall * (y + (v + gamma * y) * t), fall * (v - gamma * (v + gamma * y) * t)))
            continue
        one, two = root - gamma, -root - gamma
        p = (v - two * y) / (one - two)
        q = y - p
        a, b = p * (one * t).exp(), q * (two * t).exp()
        states.append((a + b, one * a + two * b))
    return states


def series(
    numbers: list[Decimal], start: tuple[Decimal, Decimal], times: list[Decimal]
) -> list[tuple[Decimal, Decimal]]:
    """Return the states of any other motion."""
    w, _, _, friction, cubic = numbers
    y, v = start
    now, states, waiting = Decimal(0), [], list(times)
    while waiting:
        pull = w * w * y + cubic * y**3
        if v == 0 and abs(pull) <= friction:
            states += [(y, Decimal(0))] * len(waiting)
            break
        sign = (1 if v > 0 else -1) if v != 0 else (-1 if pull > 0 else 1)
        ys, vs = coefficients(numbers, sign, y, v)
        h = length(ys, vs, w)
        turned = value(vs, h) * sign <= 0
        if turned:
            h = zero(vs, h, sign)
        while waiting and waiting[0] <= now + h:
            x = waiting.pop(0) - now
            states.append((value(ys, x), value(vs, x)))
        y, v, now = value(ys, h), Decimal(0) if turned else value(vs, h), now + h
    return states


def coefficients(numbers: list[Decimal], sign: int, y: Decimal, v: Decimal) -> tuple[list[Decimal], list[Decimal]]:
    """Return the Taylor coefficients of displacement and velocity while the velocity keeps its sign."""
    w, gamma, drag, friction, cubic = numbers
    ys, vs, squares = [y], [v], [y * y]
    for k in range(ORDER):
        right = -w * w * ys[k] - 2 * gamma * vs[k]
        if drag:
            right -= sign * drag * sum((vs[i] * vs[k - i] for i in range(k + 1)), Decimal(0))
        if k == 0:
            right -= sign * friction
        if cubic:
            right -= cubic * sum((squares[i] * ys[k - i] for i in range(k + 1)), Decimal(0))
        ys.append(vs[k] / (k + 1))
        vs.append(right / (k + 1))
        squares.append(sum((ys[i] * ys[k + 1 - i] for i in range(k + 2)), Decimal(0)))
    return ys, vs


def length(ys: list[Decimal], vs: list[Decimal], w: Decimal) -> Decimal:
    """Return a step whose last terms are of no account to 45 digits."""
    h = PARTS / w
    size = max(abs(ys[0]), abs(vs[0]) / w)
    for c, n in ((ys[-1], ORDER), (ys[-2], ORDER - 1), (vs[-1] / w, ORDER), (vs[-2] / w, ORDER - 1)):
        if c:
            h = min(h, ((size * Decimal("1e-46") / abs(c)).ln() / n).exp())
    return h


def value(terms: list[Decimal], x: Decimal) -> Decimal:
    """Return a polynomial's value."""
    total = Decimal(0)
    for c in reversed(terms):
        total = total * x + c
    return total


def zero(vs: list[Decimal], h: Decimal, sign: int) -> Decimal:
    """Return where the velocity passes zero before h."""
    low, high = Decimal(0), h
    for _ in range(20):  # bisection brings Newton's method near
        x = (low + high) / 2
        low, high = (x, high) if value(vs, x) * sign > 0 else (low, x)
    slopes = [k * c for k, c in enumerate(vs)][1:]
    x = (low + high) / 2
    for _ in range(7):
        x -= value(vs, x) / value(slopes, x)
    return x


if __name__ == "__main__":
    main()
