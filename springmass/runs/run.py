"""A run: a recording with its analysis, which every command, page, report, course and script shows."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.analyse import Analysis, Measured, conclude, measure, of_samples
from pipeline.bench.scene import Scene
from pipeline.errors import AnalysisError
from pipeline.findings.finding import Finding
from pipeline.numerics.estimate import Estimate
from pipeline.results.classic import Classic, classic
from springmass.errors import LOG
from springmass.loading.arrays import loaded_of, refuse_reading
from springmass.loading.load import load
from springmass.loading.loaded import Loaded
from springmass.loading.options import ANALYSIS_DEFAULTS, AnalysisOptions
from springmass.loading.save import now_utc, save_run
from springmass.loading.scenes import scene_from, stated_keys
from springmass.result.frames import estimates_frame, run_dataset, samples_dataset
from springmass.result.run_json import (
    NO_DETAILS,
    RESULT_SCHEMA,
    RunResult,
    details_of,
    input_of,
    plain,
    provenance_of,
    recorded_of,
    with_traps,
)
from springmass.result.summary import html_summary, text_summary
from springmass.result.table1 import TableRow, numbers_of, table_rows

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class Run(Mapping[str, Estimate]):
    """A recording with its analysis, as :func:`springmass.load` and :func:`springmass.analyse` return it.

    It is a mapping of names and symbols to values: ``run["period"]``, ``run["T"]``, ``run["k"]``, and the coefficients
    of the selected law, ``run["gamma"]``; ``run["quadratic.beta"]`` is a parameter of any law. A value is a number of
    the ``uncertainties`` package that knows its ``unit``; values of one run are correlated, and arithmetic accounts for
    it. The recording is analysed when a result is first asked for.

    Parameters
    ----------
    loaded : Loaded
        The recording as it was read.
    stated : Scene or None
        The scene that replaces the recording's own.
    how : AnalysisOptions
        How it was read, and how it is analysed.
    name : str
        Name of the run.
    time_utc : str
        Time of the analysis that the result states; empty for the current time.

    Examples
    --------
    >>> import springmass as sm
    >>> run = sm.analyse(sm.sample_data() / "undamped_simulated_position.txt")
    >>> run["period"]
    0.758516(22) s
    >>> print(2 * run["T"])
    1.517032 +- 0.000044 s
    """

    loaded: Loaded
    stated: Scene | None = None
    how: AnalysisOptions = ANALYSIS_DEFAULTS
    name: str = ""
    time_utc: str = ""

    __hash__ = object.__hash__
    __eq__ = object.__eq__

    @classmethod
    def of(cls, source: Any, scene: Any = None, how: AnalysisOptions = ANALYSIS_DEFAULTS, name: str = "") -> Run:
        """Return the run of a path, arrays, or another run; ``scene`` is one, its tables, or the path of its file."""
        if isinstance(source, str | os.PathLike):
            loaded = load(Path(source), how, scene_given=scene is not None).within(how)
            how = replace(how, **loaded.reading)
        elif isinstance(source, Run):
            refuse_reading(how, "run that is read already")
            loaded = source.loaded.within(how)
            scene, name = source.stated if scene is None else scene, name or source.name
            how = replace(source.how, **how.given())
        else:
            loaded = loaded_of(source, how).within(how)
        return cls(loaded, scene_from(scene), how, name or loaded.path.name)

    def named(self, name: str, **changes: Any) -> Run:
        """Return the run under another name, and with other fields, with its analysis if it has one."""
        other = replace(self, name=name, **changes)
        kept = ("measured", "analysis", "classic")
        vars(other).update({each: vars(self)[each] for each in kept if each in vars(self)})
        return other

    @cached_property
    def scene(self) -> Scene:
        """The scene: the one that was given, or else the one that the recording carries."""
        where = f"{self.loaded.source or 'arrays'} (its scene)"
        return self.stated or Scene.from_mapping(self.loaded.scene or {}, where=where)

    @cached_property
    def analysis(self) -> Analysis:
        """The analysis; its findings include those of the reader."""
        if self.name:  # without one, the samples are arrays, or those so far of a recording
            with_scene = f"with a scene that states {stated_keys(self.scene)}"
            LOG.debug(f"analysed: {self.name} at {self.how.accuracy}, {with_scene}")
        analysis = conclude(self.measured, self.scene)
        return replace(analysis, findings=with_traps(analysis.findings, self.loaded.traps))

    @cached_property
    def measured(self) -> Measured:
        """What follows from the samples, whatever the bench weighs."""
        return measure(self.loaded.track, self.scene, self.how.options)

    def on_bench(self, scene: Scene) -> Run:
        """Return the run with another scene; what follows from the samples alone is not calculated again."""
        other = replace(self, stated=scene)
        if "measured" in vars(self) and of_samples(scene) == of_samples(self.scene):
            vars(other)["measured"] = self.measured
        return other

    @cached_property
    def classic(self) -> Classic | None:
        """The result of the lab report's own method, if ``how`` asks for it."""
        return None if self.how.method is None else classic(self.loaded.track, self.scene)

    @cached_property
    def result(self) -> dict[str, Any]:
        """The result as JSON has it: what ``springmass analyse --json`` prints and the report stores."""
        loaded, analysis, classic, how = self.loaded, self.analysis, self.classic, self.how
        parameters = {**how.parameters, "scene": self.scene.to_mapping()}
        content: RunResult = {
            "schema": RESULT_SCHEMA,
            # The estimates of the lab report's own method replace those of the analysis.
            "estimates": analysis.estimates if classic is None else classic.estimates,
            **(details_of(analysis) if classic is None else NO_DETAILS),
            "findings": analysis.findings,
            "effects": analysis.effects,
            "quality": {**analysis.quality, "malformed_rows": loaded.recording.malformed_rows},
            "input": input_of(loaded),
            "recorded": recorded_of(loaded),
            "provenance": provenance_of(how.method or how.accuracy, parameters, self.time_utc or now_utc()),
        }
        return {name: plain(value) for name, value in content.items()}

    @property
    def ok(self) -> bool:
        """Whether the run oscillates or relaxes, so that there is something to report."""
        return self.analysis.ok

    @property
    def why(self) -> str:
        """Why the run is not ``ok``, as a sentence; empty if it is."""
        return "" if self.ok else self.analysis.why

    @property
    def law(self) -> str | None:
        """The name of the damping law that fits best or is stated; None without an oscillation."""
        return self.analysis.damping.selected or None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the reader and the analysis found, the most severe first."""
        return self.analysis.findings

    @property
    def recorded(self) -> Mapping[str, Any]:
        """What the recording states about its origin: start time, title, marks, events, calibration."""
        return {**self.loaded.provenance, "title": self.loaded.title}

    @property
    def rows(self) -> tuple[TableRow, ...]:
        """The lines of Table 1."""
        return table_rows([self.analysis])

    def __getitem__(self, name: str) -> Estimate:
        everything, fits = numbers_of(self.analysis), self.analysis.damping.fits
        if name in everything:
            return everything[name]
        for row in self.rows:
            (estimate,) = row.estimates
            if estimate is not None and name in (row.symbol, row.on_screen):
                return estimate
        law, _, parameter = name.partition(".")
        if law in fits:
            parameters = self.analysis.derived.parameters_of(fits[law])
            if parameter in parameters:
                return parameters[parameter]
        if name in ("spring_constant", "k") and self.scene.bob_mass_kg is None and "period" in everything:
            raise _NoValue(f"{name} needs the mass of the bob: pass scene=Scene(bob_mass_kg=(KG, U_KG))")
        errors = [finding.message for finding in self.findings if finding.severity == "error"]
        why = f": {self.why or errors[0]}" if self.why or errors else ""
        raise _NoValue(
            f"no estimate {name!r} of this run{why}; there are {', '.join(everything) or 'none'}: see "
            "docs/reference/estimates.md for what others need of record and scene"
        )

    def __iter__(self) -> Iterator[str]:
        return iter(numbers_of(self.analysis))

    def __len__(self) -> int:
        return len(numbers_of(self.analysis))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def plot(self, chart: str = "position", ax: Axes | None = None) -> Axes:
        """Draw a chart of the report into ``ax``, or into a new figure, and return the axes.

        Parameters
        ----------
        chart : str
            "position", "amplitude", "frequency", "spectrum", "drag", "energy", "motion", "phase" or "contour".
        ax : matplotlib.axes.Axes, optional

        Raises
        ------
        springmass.Error
            If there is no such chart, or the run does not give it.
        """
        from springmass.charts.draw import draw
        from springmass.charts.run import CHARTS

        if chart not in CHARTS:
            raise AnalysisError(f"no chart {chart!r}", f"there are {', '.join(CHARTS)}")
        drawn = CHARTS[chart](self.analysis)
        if drawn is None:
            if self.analysis.oscillation is None:
                raise AnalysisError(f"only its position can be drawn, nothing oscillates: {self.analysis.why}")
            needs = {
                "drag": "[bob] mass_kg, [disc] diameter_m and an amplitude that falls",
                "contour": "a damping law of two parameters",
            }
            what = needs.get(chart, "more periods")
            raise AnalysisError(f"the chart {chart} needs {what}", "state them in the scene, or record longer")
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(layout="constrained")[1]
        draw(drawn.panels[0], ax)
        ax.legend(fontsize="small")
        return ax

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
        return estimates_frame(self.analysis, correlations=correlations)

    def dataset(self) -> xr.Dataset:
        """Return the samples as they were recorded, with all that is known about them in the attributes.

        :func:`springmass.analyse` takes such a dataset, also after a selection by time, and uses all of it. The bytes
        of the original files are not in it; :meth:`save` keeps them.
        """
        return samples_dataset(self.loaded, self.scene)

    def to_dataset(self) -> xr.Dataset:
        """Return :meth:`dataset` with the analysis: every sample with its fit, every window, every estimate.

        Returns
        -------
        xarray.Dataset
            Along ``time``: distance, quality and left_out and, for an oscillation, fit, residual, rest and the smoothed
            motion with its uncertainties. Along ``window``: amplitude_of_window, u_amplitude_of_window, kept and
            phase_of_window. Along ``law`` and ``window``: law_amplitude. Estimates have no dimension; their ``u`` and
            ``units`` are attributes.
        """
        return run_dataset(self.loaded, self.analysis, self.name)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the recording to a run file with its scene, calibration, flags and original files.

        Parameters
        ----------
        path : path
            The file to create, ``NAME.h5``.
        overwrite : bool
            Whether an existing file may be replaced.
        """
        return save_run(path, self.loaded, scene=self.scene.to_mapping() or None, overwrite=overwrite)

    def __repr__(self) -> str:
        return text_summary(self.analysis, self.name)

    def _repr_html_(self) -> str:
        return html_summary(self.analysis, self.name)


class _NoValue(KeyError):
    """The error for a name that no estimate has; its message is shown as a plain sentence, not as a repr."""

    def __str__(self) -> str:
        return str(self.args[0])
