"""One analysed run for a notebook: estimates by name, a page-wide summary, figures, frames and datasets."""

from __future__ import annotations

from collections.abc import Iterator, KeysView, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.analyse import Analysis as Found
from pipeline.analyse import Oscillation
from pipeline.numerics.estimate import Estimate
from springmass.api.frames import estimates_frame, run_dataset
from springmass.api.plotting import Plot
from springmass.api.showing import html_summary, text_summary
from springmass.api.values import Value
from springmass.report.tables import table_rows

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Analysis"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Analysis(Found):
    """An analysed run, as :func:`springmass.analyse` returns it.

    Parameters
    ----------
    name : str
        Name of the run; the name of its file if it came from a file.

    Notes
    -----
    ``a["period"]`` is a number of the ``uncertainties`` package that knows its ``unit``; ``value`` and ``u`` are plain
    numbers. Valid names are those of ``docs/reference/estimates.md``, their symbols (``a["k"]``, ``a["T"]``) and the
    coefficients of the selected law (``a["gamma"]``). ``LAW.PARAMETER`` is a parameter of any law
    (``a["quadratic.beta"]``). It can be used as a mapping of names to values. Estimates of one analysis
    are correlated, and arithmetic takes this into account. Estimates of two analyses are treated as independent;
    :func:`springmass.compare` accounts for what two runs share.

    Examples
    --------
    >>> import springmass as sm
    >>> a = sm.analyse(sm.sample_data() / "undamped_simulated_position.txt")
    >>> a["period"]
    0.758516(22) s
    >>> print(2 * a["T"])
    1.517032 +- 0.000044 s
    """

    name: str = ""

    def __getitem__(self, name: str) -> Value:
        everything = self._found()
        if name in everything:
            return Value.of(everything[name])
        for row in table_rows([self]):
            (estimate,) = row.estimates
            if estimate is not None and name in (row.symbol, row.page_symbol.replace(" ", "_")):
                return Value.of(estimate)
        law, _, parameter = name.partition(".")
        if isinstance(self.motion, Oscillation) and law in self.motion.damping.fits:
            parameters = self.motion.derived.parameters_of(self.motion.damping.fits[law])
            if parameter in parameters:
                return Value.of(parameters[parameter])
        if name in ("spring_constant", "k") and self.scene.bob_mass_kg is None and "period" in everything:
            raise _NoEstimate(f"{name} needs the mass of the bob: pass scene=Scene(bob_mass_kg=(KG, U_KG))")
        errors = [finding.message for finding in self.findings if finding.severity == "error"]
        why = f": {errors[0]}" if errors else ""
        raise _NoEstimate(
            f"no estimate {name!r} of this run{why}; there are {', '.join(everything) or 'none'}: see "
            "docs/reference/estimates.md for what others need of record and scene"
        )

    def _found(self) -> Mapping[str, Estimate]:
        """Return all estimates and the coefficients of the selected law, by name."""
        law = self.motion.derived.coefficients if isinstance(self.motion, Oscillation) else {}
        return {**self.estimates, **law}

    def __contains__(self, name: object) -> bool:
        try:
            self[str(name)]
        except KeyError:
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        return iter(self._found())

    def __len__(self) -> int:
        return len(self._found())

    def keys(self) -> KeysView[str]:
        """Return the names of the estimates."""
        return self._found().keys()

    def values(self) -> list[Value]:
        """Return the estimates, in the order of their names."""
        return [self[name] for name in self]

    def items(self) -> list[tuple[str, Value]]:
        """Return the names of the estimates with their values."""
        return [(name, self[name]) for name in self]

    def get(self, name: str, default: Any = None) -> Any:
        """Return an estimate by name or symbol, or ``default`` if the run has none of that name."""
        try:
            return self[name]
        except KeyError:
            return default

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    @property
    def plot(self) -> Plot:
        """Figures: ``a.plot()``, ``a.plot.amplitude(ax=ax)`` and others, see :class:`springmass.api.plotting.Plot`."""
        return Plot(self)

    def to_dataframe(self, *, correlations: bool = False) -> pd.DataFrame:
        """Return one row per estimate, by name.

        Parameters
        ----------
        correlations : bool
            Whether to append columns ``r(NAME)`` with the correlation coefficients.

        Returns
        -------
        pandas.DataFrame
            A frame with the columns quantity, symbol, value, u, unit, dof, coverage_factor and expanded. The last three
            are those of the budget in the JSON output, and are NaN for an estimate without a budget.
        """
        return estimates_frame(self, correlations=correlations)

    def to_dataset(self) -> xr.Dataset:
        """Return every sample with its fit, every window with its amplitude, and every estimate.

        Returns
        -------
        xarray.Dataset
            Along ``time``: distance and quality and, for an oscillation, fit, residual, rest and the smoothed motion
            with its uncertainties. Along ``window``: amplitude_of_window, u_amplitude_of_window, kept and
            phase_of_window. Along ``law`` and ``window``: law_amplitude. Estimates have no dimension; their ``u`` and
            ``units`` are attributes.
        """
        return run_dataset(self)

    def __repr__(self) -> str:
        return text_summary(self)

    def _repr_html_(self) -> str:
        return html_summary(self)


class _NoEstimate(KeyError):
    """The error for a name that no estimate has; its message is shown as a plain sentence, not as a repr."""

    def __str__(self) -> str:
        return str(self.args[0])
