"""Every recording in xarray: ``xr.open_dataset("position.txt", engine="springmass")``."""

import os
from collections.abc import Iterable
from typing import Any

import xarray as xr
from xarray.backends import BackendEntrypoint

from springmass.api.analysing import load
from springmass.loading.inputs import kind_of


class Engine(BackendEntrypoint):
    """Opens recordings, run files and wire logs; keyword arguments are those of :func:`springmass.load`."""

    description = "Recordings, run files and wire logs of rangefinders"
    open_dataset_parameters = ("filename_or_obj", "drop_variables")

    def open_dataset(
        self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None, **how: Any
    ) -> xr.Dataset:
        """Return the samples with all that is known about them in the attributes."""
        dropped = [drop_variables] if isinstance(drop_variables, str) else list(drop_variables or ())
        return load(os.fspath(filename_or_obj), **how).dataset().drop_vars(dropped)

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Return whether this is a run file: all else is opened only by name."""
        if not isinstance(filename_or_obj, str | os.PathLike) or kind_of(filename_or_obj) != "run":
            return False
        import h5py

        with h5py.File(filename_or_obj) as file:
            return "entry/provenance/header" in file
