"""The files of ``../shared/cases`` that an analysis answers with values, and what their ``want.txt`` says is true."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import springmass
from tests.trials.grades.graded import Said, Truth, said_of

CASES = Path(__file__).resolve().parents[4] / "shared" / "cases"


@dataclass(frozen=True)
class Case:
    """A file, how it is read, and what is true of it."""

    file: str
    truth: Mapping[str, Truth]
    scene: Mapping[str, Any] = field(default_factory=dict)
    unit: str | None = None

    def said(self) -> Said:
        """Return what the program says of it; nothing if it refuses the file."""
        how = {} if self.unit is None else {"unit": self.unit}
        try:
            return said_of(springmass.analyse(CASES / self.file, self.scene or None, **how).analysis)
        except springmass.Error:
            return Said()


NO_DRAG = {"beta": 0.0, "mu": 0.0}
WEIGHED = {"bob": {"mass_kg": {"value": 0.2, "u": 1e-4}}, "spring": {"mass_kg": {"value": 0.01, "u": 2e-4}}}


def _pendulum(u: float) -> dict[str, Any]:
    return {"pendulum": {"length_m": {"value": 1.0, "u": u}}}


FILES: Mapping[str, Case] = {
    "strong-pendulum": Case("strong-pendulum/swing30.csv", {"amplitude": 0.5236, "period": (1.2711, 1.2934)}),
    "strong-creep": Case(
        "strong-creep/creep1.csv", {"period": 0.79, "amplitude": (0.05, 0.054), "offset": (0.4, 0.404)}
    ),
    "brake-switched": Case(
        "brake-switched/brake.csv",
        {"period": 0.79, "amplitude": 0.05, "damping_rate": 0.06, "gamma": (0.02, 0.06), **NO_DRAG},
    ),
    "moving-rest": Case("moving-rest/glider.csv", {"period": 0.79, "amplitude": 0.05, "damping_rate": 0.01}),
    "cavendish-moved": Case(
        "cavendish-moved/moved.csv", {"period": 615.0, "offset": lambda at: 0.12 if at < 3600.0 else 0.096}
    ),
    "turning-plane": Case(
        "turning-plane/turning.csv", {"period": 2.0, "amplitude": 0.15, "damping_rate": 0.003, **NO_DRAG}
    ),
    "ellipse": Case(
        "ellipse/ellipse.csv", {"period": 2.0, "period_small_swings": 2.0, "damping_rate": 0.003, **NO_DRAG}
    ),
    "close-modes": Case(
        "close-modes/close.csv",
        {"period": (0.7854, 0.79), "period_small_swings": (0.7854, 0.79), "damping_rate": 0.01, **NO_DRAG},
    ),
    "slack-string": Case(
        "slack-string/slack.csv", {"period_small_swings": 0.75098, "damping_rate": 0.015, "gamma": 0.015, **NO_DRAG}
    ),
    "magnitude": Case("magnitude/absolute.csv", {"period": 0.79}),
    "radial-acceleration": Case(
        "radial-acceleration/radial.csv", {"period": (2.0061, 2.0116), "period_small_swings": 2.0061}
    ),
    "magnet-pendulum": Case(
        "magnet-pendulum/far.csv", {"period": (2.006, 2.012), "period_small_swings": 2.006}, unit="1"
    ),
    "autocorrelation": Case("autocorrelation/Autocorrelation.csv", {"period": 1.35, "damping_rate": 0.03}, unit="1"),
    "driven": Case("driven/driven.csv", {"spring_constant": 14.0}, WEIGHED),
    "mains-hum": Case("mains-hum/hum.csv", {"period": 1.0 / 7.3, "damping_rate": 0.2}),
    "three-modes": Case("three-modes/chain.csv", {"period": (1.0 / 1.14, 1.0)}),
    "cantilever-overtone": Case("cantilever-overtone/beam.csv", {"period": 1.0 / 2.3, "damping_rate": 0.072}),
    "irregular-slow": Case("irregular-slow/iot.csv", {"period": 0.79}),
    "ambient": Case("ambient/bridge6.csv", {"period": (0.4738, 0.4786)}),
    "cavendish-spot": Case("cavendish-spot/spot.csv", {"period": 615.0, "damping_rate": 1.0 / 1500.0}),
    "leaking-mass": Case(
        "leaking-mass/drip.csv",
        {"period": (0.78921, 0.79), "period_small_swings": (0.78921, 0.79), "damping_rate": 0.01},
    ),
    "frame-rate": Case("frame-rate/slowing.csv", {"period": (1.14, 1.2), "period_small_swings": (1.14, 1.2)}),
    "pendulum-position": Case(
        "pendulum-position/x25.csv", {"period_small_swings": 2.006067, "gravity": 9.81}, _pendulum(1e-3)
    ),
    "pendulum-gyro": Case(
        "pendulum-gyro/gyro35.csv", {"period_small_swings": 2.006067, "gravity": 9.81}, _pendulum(1e-4)
    ),
}
