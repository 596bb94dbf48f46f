"""Run files opened by scripts: selection of a part by time, and analysis."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from springmass.api.analysis import Analysis
from springmass.api.sources import analyse
from storage.run_file.reading import Run as Stored

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Part", "Run", "open_run"]


class Run(Stored):
    """An open run file with the additional methods :meth:`sel` and :meth:`analyse`.

    Everything else is as in :class:`storage.run_file.reading.Run`.
    """

    def sel(self, *, time: slice) -> Part:
        """Return the samples between two times, as xarray's ``sel`` does.

        Parameters
        ----------
        time : slice
            Start and end in s, both included: ``slice(5, 60)``, ``slice(5, None)``.

        Raises
        ------
        ValueError
            If the slice has a step.
        """
        if not isinstance(time, slice) or time.step is not None:
            raise ValueError(f"time must be a slice of two times in s without a step, got {time!r}")
        return Part(self, time.start, time.stop)

    def analyse(self, scene: Any = None, **how: Any) -> Analysis:
        """Analyse the run; see :func:`springmass.analyse`."""
        return analyse(self, scene, **how)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """The samples of a run between two times.

    Parameters
    ----------
    run : Run
    from_s, to_s : float or None
        Start and end in s, both included; None means the first or the last sample.
    """

    run: Run
    from_s: float | None
    to_s: float | None

    def analyse(self, scene: Any = None, **how: Any) -> Analysis:
        """Analyse these samples; see :func:`springmass.analyse`."""
        return analyse(self.run, scene, from_s=self.from_s, to_s=self.to_s, **how)

    def dataset(self) -> xr.Dataset:
        """Return these samples as a checked dataset in memory."""
        return self.run.dataset().sel(time=slice(self.from_s, self.to_s))


def open_run(path: str | os.PathLike[str], *, unverified: bool = False) -> Run:
    """Open a run file for reading; use it in a ``with`` block or close it.

    Parameters
    ----------
    path : str or PathLike
    unverified : bool
        Whether to return data that do not match their digest, for inspection.

    Raises
    ------
    storage.errors.NotARun, storage.errors.RunDamaged, storage.errors.RunOpen
        Under the same conditions as in :class:`storage.run_file.reading.Run`.
    """
    return Run(path, unverified=unverified)
