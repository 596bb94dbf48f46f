"""The command lines that were frozen after the first set: a course, comparisons and simulations against recordings."""

from __future__ import annotations

TORONTO = "{0}/AyushPandhi__Pandhi_Ayush_PHY224"
BENCH = "{2}/bench.scene.toml"
LONG, SHORT = f"{TORONTO}/damped position.txt", f"{TORONTO}/position data.txt"
OTHER, WEAK = "{0}/pankaj9um__PHY224/undamped_point_data.txt", "{0}/pankaj9um__PHY224/undamped_point_data_set2.txt"
THIRD = "{0}/kamjha__PHY224/position_osc.txt"
CAPSTONE = "{0}/filo0509__smorzamento/molla_durissima_discopieno_14.91945_0.2016_1.csv"
WHOLE = "{2}/whole_bench.scene.toml"
SCENES = ["--scene", "{1}/undamped.scene.toml", "--scene", "{1}/damped.scene.toml"]


def further() -> list[list[str]]:
    """Return the command lines; golden.py says what the braces stand for."""
    pairs = [
        (SHORT, LONG),
        (LONG, SHORT),
        (SHORT, OTHER),
        (OTHER, WEAK),
        (SHORT, THIRD),
        (LONG, OTHER),
        (SHORT, SHORT),
        (SHORT, OTHER, THIRD),
        (SHORT, LONG, OTHER, WEAK, THIRD),
    ]
    found = [["compare", *runs, "--scene", BENCH, "--json"] for runs in pairs]
    found.append(["compare", SHORT, LONG, *SCENES, "--json"])
    for recording in (SHORT, LONG, OTHER, THIRD, WEAK):
        found.append(["simulate", "--scene", BENCH, "--against", recording, "--json"])
    for recording, seconds in ((SHORT, "5"), (OTHER, "5")):
        for method in ("forward-euler", "symplectic-euler"):
            words = ["--seconds", seconds, "--method", method, "--dt", "0.001", "--force"]
            found.append(["simulate", "--scene", BENCH, "--against", recording, *words, "--json"])
    found.append(["simulate", "--scene", WHOLE, "--against", THIRD, "--json"])
    found.append(["batch", "{C}", "-o", "{O}/course", "--reports", "0", "--jobs", "1", "--scene", BENCH])
    return found
