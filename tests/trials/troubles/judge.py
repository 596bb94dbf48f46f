"""The verdict on a record: are its numbers right within their uncertainties, and if not, is the trouble named."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.analyse import Analysis, analyse
from pipeline.bench.scene import Scene
from pipeline.errors import AnalysisError
from pipeline.options import options_for
from pipeline.results.derive import Derived
from pipeline.track import Track
from springmass.loading.options import AnalysisOptions
from springmass.runs.run import Run
from tests.trials.troubles.record import Kind, Record, Truth

LIMIT = 4.0  # stated uncertainties beyond which a number is wrong
# Share of the damping rate at the start beyond which a term of the true law may not be missing in a law that is quoted.
MISSED = 0.1
COEFFICIENTS = frozenset({"mu", "gamma", "beta", "c", "n"})
LEAVES_OUT = frozenset({"at_rest", "handled", "restarted", "touched", "phase_jump", "long_gap"})


@dataclass(frozen=True, slots=True)
class Given:
    """One estimate held against the truth."""

    error: float
    u: float
    u_own: float  # what the record's own scatter contributes to u

    @property
    def z(self) -> float:
        """The error in stated uncertainties; infinite where something exact is wrong."""
        if not np.isfinite(self.error):
            return float("inf")
        return abs(self.error) / self.u if self.u > 0 else (0.0 if self.error == 0 else float("inf"))


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of one record."""

    kind: str
    given: Mapping[str, Given]  # the estimates that have a truth
    warnings: tuple[str, ...]  # codes of the findings that are warnings or errors
    refused: bool  # whether none of the estimates that have a truth was given
    named: bool  # whether a warning names the kind

    @property
    def worst(self) -> float:
        """The greatest error in stated uncertainties."""
        return max((one.z for one in self.given.values()), default=0.0)

    @property
    def word(self) -> str:
        """The verdict in a word: right if numbers are given and every one lies within the limit."""
        if not self.refused and self.worst <= LIMIT:
            return "right"
        if self.named:
            return "named"
        return "refused" if self.refused else "confident wrong"


def try_one(kind: Kind, seed: int, tier: str) -> Verdict:
    """Make the record of a seed, analyse it and judge."""
    record = kind.make(seed)
    try:
        analysis = _analysed(record, tier)
    except AnalysisError as error:
        # A refusal names the trouble if it does so by a finding's code; its sentence is not searched for words.
        code = getattr(error, "code", "")
        return Verdict(kind.name, {}, (code,) if code else (), True, code in kind.codes)
    warnings = tuple(dict.fromkeys(f.code for f in analysis.findings if f.severity != "info"))
    given = _held_against(analysis, record)
    sought = [name for name in record.truth if name not in COEFFICIENTS | {"offset", "noise"}]
    refused = bool(sought) and not any(name in given for name in sought)
    named = bool(kind.codes & set(warnings))
    return Verdict(kind.name, given, warnings, refused, named)


def _analysed(record: Record, tier: str) -> Analysis:
    scene = Scene.from_mapping(record.scene)
    if record.text is None:
        return analyse(replace(Track.from_arrays(record.t, record.y), **record.track), scene, options_for(tier))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial_position.txt"
        path.write_bytes(record.text)
        return Run.of(path, scene, AnalysisOptions(accuracy=tier)).analysis


def _held_against(analysis: Analysis, record: Record) -> dict[str, Given]:
    begin, own = _beginning(analysis), analysis.derived.statistical
    held = _held_coefficients(analysis.derived, record, begin)
    for name, truth in record.truth.items():
        stated = analysis.estimates.get(name)
        if stated is not None:
            held[name] = Given(stated.value - _at(truth, begin), stated.u, own[name].u)
    if "period" not in record.truth and "period" in analysis.estimates:
        # Nothing moves that has a period: whatever stands there is wrong, however wide.
        held["period"] = Given(float("inf"), 1.0, 1.0)
    return held


def _held_coefficients(derived: Derived, record: Record, begin: float) -> dict[str, Given]:
    """The coefficients that may be quoted, and their law if it lacks a term of the true one that matters."""
    true = {name: _at(record.truth[name], begin) for name in record.truth if name in COEFFICIENTS}
    if not (derived.quoted and true):
        return {}
    held = {
        name: Given(
            derived.coefficients[name].value - truth, derived.coefficients[name].u, derived.budgets[name].u_of("A")
        )
        for name, truth in true.items()
        if name in derived.coefficients
    }
    if "c" not in true:
        size = derived.estimates["amplitude"].value
        rates = {"mu": true["mu"] / size, "gamma": true["gamma"], "beta": true["beta"] * size}
        missing = sum(rate for name, rate in rates.items() if name not in derived.coefficients)
        if missing > MISSED * sum(rates.values()):
            held["law"] = Given(float("inf"), 1.0, 1.0)
    return held


def _at(truth: Truth, begin: float) -> float:
    return truth(begin) if callable(truth) else truth


def _beginning(analysis: Analysis) -> float:
    """The moment that amplitude and damping rate are stated for, s.

    It is the first sample, unless a finding says that a part is left out.
    """
    said = any(finding.code in LEAVES_OUT for finding in analysis.findings)
    if said or analysis.ok:
        return analysis.motion.start_s
    return float(analysis.track.t[np.flatnonzero(np.isfinite(analysis.track.y))[0]])
