"""The 27 nonlinear data sets of NIST's Statistical Reference Datasets: models here, numbers in ``nist/``.

Observed and generated data, both starts, certified values and standard deviations are those of the tables that NIST
published at itl.nist.gov/div898/strd (public domain), as they travel in the source distribution of lmfit 1.3.4.
Rat43 states nine degrees of freedom there; its certified residual standard deviation is that of eleven.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
Model = Callable[[F8, F8], F8]  # (x, b) -> y

HERE = Path(__file__).parent / "nist"


@dataclass(frozen=True, slots=True, eq=False)
class DataSet:
    """One set; y of Nelson is the logarithm, which is what its model describes."""

    name: str
    x: F8  # (n,) or (2, n)
    y: F8
    starts: F8  # (2, p): far and near
    certified: F8
    deviation: F8
    rss: float  # certified residual sum of squares
    dof: int

    def residuals(self, b: F8) -> F8:
        """Return model less data, (n,)."""
        with np.errstate(all="ignore"):
            return MODELS[self.name](self.x, b) - self.y


def read(name: str) -> DataSet:
    """Read one set."""
    _, *lines = (HERE / f"{name}.txt").read_text(encoding="ascii").splitlines()
    split = [line.split() for line in lines if not line.startswith("#")]
    table = np.array([row[1:] for row in split if row[0] == "p"], np.float64)
    ((rss, dof),) = (row[1:] for row in split if row[0] == "s")
    data = np.array([row for row in split if row[0] not in "ps"], np.float64)
    x, y = data[:, 1:].T, data[:, 0]
    return DataSet(
        name=name,
        x=x[0] if len(x) == 1 else x,
        y=np.log(y) if name == "Nelson" else y,
        starts=table[:, :2].T,
        certified=table[:, 2],
        deviation=table[:, 3],
        rss=float(rss),
        dof=int(dof),
    )


def digits(found: F8, certified: F8) -> float:
    """Return how many digits agree in the worst parameter: -log10 of the largest relative error, at most 11."""
    with np.errstate(all="ignore"):
        error = np.max(np.abs(found - certified) / np.abs(certified))
    return 0.0 if not np.isfinite(error) else float(min(max(-np.log10(max(error, 1e-11)), 0.0), 11.0))


def _exponentials(x: F8, b: F8) -> F8:
    return b[0] * np.exp(-b[1] * x) + b[2] * np.exp(-b[3] * x) + b[4] * np.exp(-b[5] * x)


def _peaks(x: F8, b: F8) -> F8:
    first = b[2] * np.exp(-((x - b[3]) ** 2) / b[4] ** 2)
    second = b[5] * np.exp(-((x - b[6]) ** 2) / b[7] ** 2)
    return b[0] * np.exp(-b[1] * x) + first + second


def _cubic_ratio(x: F8, b: F8) -> F8:
    above = b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3
    return above / (1.0 + b[4] * x + b[5] * x**2 + b[6] * x**3)


def _months(x: F8, b: F8) -> F8:
    year, second, third = (2.0 * np.pi * x / period for period in (12.0, b[3], b[6]))
    yearly = b[0] + b[1] * np.cos(year) + b[2] * np.sin(year)
    return yearly + b[4] * np.cos(second) + b[5] * np.sin(second) + b[7] * np.cos(third) + b[8] * np.sin(third)


MODELS: dict[str, Model] = {
    "Bennett5": lambda x, b: b[0] * (b[1] + x) ** (-1.0 / b[2]),
    "BoxBOD": lambda x, b: b[0] * (1.0 - np.exp(-b[1] * x)),
    "Chwirut1": lambda x, b: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "Chwirut2": lambda x, b: np.exp(-b[0] * x) / (b[1] + b[2] * x),
    "DanWood": lambda x, b: b[0] * x ** b[1],
    "ENSO": _months,
    "Eckerle4": lambda x, b: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": _peaks,
    "Gauss2": _peaks,
    "Gauss3": _peaks,
    "Hahn1": _cubic_ratio,
    "Kirby2": lambda x, b: (b[0] + b[1] * x + b[2] * x**2) / (1.0 + b[3] * x + b[4] * x**2),
    "Lanczos1": _exponentials,
    "Lanczos2": _exponentials,
    "Lanczos3": _exponentials,
    "MGH09": lambda x, b: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "MGH10": lambda x, b: b[0] * np.exp(b[1] / (x + b[2])),
    "MGH17": lambda x, b: b[0] + b[1] * np.exp(-x * b[3]) + b[2] * np.exp(-x * b[4]),
    "Misra1a": lambda x, b: b[0] * (1.0 - np.exp(-b[1] * x)),
    "Misra1b": lambda x, b: b[0] * (1.0 - (1.0 + b[1] * x / 2.0) ** -2.0),
    "Misra1c": lambda x, b: b[0] * (1.0 - (1.0 + 2.0 * b[1] * x) ** -0.5),
    "Misra1d": lambda x, b: b[0] * b[1] * x / (1.0 + b[1] * x),
    "Nelson": lambda x, b: b[0] - b[1] * x[0] * np.exp(-b[2] * x[1]),
    "Rat42": lambda x, b: b[0] / (1.0 + np.exp(b[1] - b[2] * x)),
    "Rat43": lambda x, b: b[0] / (1.0 + np.exp(b[1] - b[2] * x)) ** (1.0 / b[3]),
    "Roszman1": lambda x, b: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": _cubic_ratio,
}
