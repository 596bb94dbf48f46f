"""Judge the values that somebody printed about runs against the recordings, and name the mistake that explains them."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from acquisition.recordings.units import measure_of, time_unit
from pipeline.analyse import Oscillation
from pipeline.findings.finding import Finding, by_severity, word
from pipeline.numerics.estimate import Estimate
from pipeline.registry.found import Found
from pipeline.registry.quantities import QUANTITIES
from pipeline.results.classic import CYCLES, READING_S, STATED_ERROR_M
from springmass.errors import USAGE, ProgramError
from springmass.runs.run import Run
from springmass.runs.table_lines import table_lines

COLUMNS = ("run", "name", "value", "u", "unit")
APART = 4.0  # differences beyond so many standard uncertainties are no chance
TOO_SMALL = 3.0  # an uncertainty is too small if what is sure to be in it is so many times larger: one digit is printed
POWERS = (-1, 1, -2, 2, -3, 3, -4, 4, -5, 5, -6, 6)
ROUGHLY = 0.05  # of a value with a wrong power of ten, which may be off otherwise too
ECHOES = 1.05  # least ratio of a velocity with false echoes to that of the motion
PERIODIC = {"period": 1, "frequency": -1, "angular_frequency": -1, "spring_constant": -2}
"""Quantities that follow from the period, each with the power of the period."""
_ALSO = {"A": "amplitude", "w": "angular_frequency", "v": "velocity_rms", "sensor_error": "noise", "s": "noise"}
_NAMES = {
    **{spelling: q.name for q in QUANTITIES.values() for spelling in (q.symbol, q.page_symbol.replace(" ", "_"))},
    **_ALSO,
}
_UNITS = {"s^-1": "1/s", "1/s": "rad/s", "rad/s": "1/s", "kg/s^2": "N/m", "kg/s²": "N/m", "s⁻¹": "1/s"}
_SCALED = {("N/cm", "N/m"): 1e2, ("N/mm", "N/m"): 1e3, ("mN/mm", "N/m"): 1.0, ("1/min", "1/s"): 1.0 / 60.0}


@dataclass(frozen=True, slots=True)
class Reported:
    """A printed value: of which run and quantity, as it was printed and in SI units, and in the end what it is.

    ``rounding`` is half of its last printed digit, ``found`` is the value of this analysis that it was compared with.
    """

    run: str
    name: str
    printed: str
    value: float
    u: float
    rounding: float
    unit: str
    found: Estimate | None = None
    verdict: str = "not compared: the recording gives no such value"


def read_reported(path: str | os.PathLike[str], runs: Sequence[Run]) -> list[Reported]:
    """Read a table with the columns run, name, value, u, unit; errors name the line and what to write."""
    table = [(line, [cell.strip() for cell in cells], comma) for line, cells, comma in table_lines(Path(path), "table")]
    head = [name.lower() for name in table[0][1]] if table else []
    if not {"run", "name", "value"} <= set(head):
        raise ProgramError(f"{path}: expected the columns {', '.join(COLUMNS)}, got {', '.join(head) or 'none'}", USAGE)
    return [
        _row(f"{path}, line {line}", dict(zip(head, cells, strict=False)), runs, decimal_comma=comma)
        for line, cells, comma in table[1:]
        if any(cells)
    ]


def _row(where: str, cells: Mapping[str, str], runs: Sequence[Run], *, decimal_comma: bool) -> Reported:
    text = {name: cells.get(name, "") for name in COLUMNS}
    numbers = {}
    for name in ("value", "u"):
        given = text[name].replace(",", ".") if decimal_comma else text[name]
        try:
            numbers[name] = Decimal(given) if given or name == "value" else Decimal(0)
        except InvalidOperation:
            numbers[name] = Decimal("nan")
        if not numbers[name].is_finite() or (name == "u" and numbers[name] < 0):
            raise ProgramError(f"{where}: {name} must be a number in SI notation, got {text[name]!r}", USAGE)
    names = [run.name for run in runs]
    begun = [name for name in names if name.lower().startswith(text["run"].lower())]
    of = [text["run"]] if text["run"] in names else begun
    if len(of) != 1:
        raise ProgramError(f"{where}: {text['run']!r} must be one of {', '.join(names)}, or its beginning", USAGE)
    name = text["name"] if text["name"] in QUANTITIES else _NAMES.get(text["name"], text["name"])
    factor = _factor(where, text["unit"], QUANTITIES[name].unit_in("m")) if name in QUANTITIES else 1.0
    rounding = 0.5 * 10.0 ** float(numbers["value"].as_tuple().exponent)
    printed = " ".join(filter(None, [text["value"], text["u"] and f"+- {text['u']}", text["unit"]]))
    value, u = (float(numbers[key]) * factor for key in ("value", "u"))
    return Reported(of[0], name, printed, value, u, rounding * factor, text["unit"])


def _factor(where: str, unit: str, si: str) -> float:
    """Return the number of SI units in a printed unit; none is the SI unit."""
    if unit in ("", si) or si in (_UNITS.get(unit), _UNITS.get(_UNITS.get(unit, ""))):
        return 1.0
    if (unit, si) in _SCALED:
        return _SCALED[unit, si]
    measure = time_unit(unit) if si == "s" else measure_of(unit)
    if measure is None or measure.si != si:
        raise ProgramError(f"{where}: the unit {unit!r} is none of this quantity; give {si or 'no unit'}", USAGE)
    return float(10.0**measure.power * measure.factor)


def judge(rows: Sequence[Reported], runs: Sequence[Run]) -> tuple[tuple[Reported, ...], tuple[Finding, ...]]:
    """Return each row with its verdict, and a finding for each mistake, the most severe first."""
    benches = {run.name: _Bench(run) for run in runs}
    judged: list[Reported] = []
    found: list[Found] = []
    exchanged: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        bench = benches[row.run]
        others = [other for name, other in benches.items() if name != row.run]
        wrong, verdict, shift = _value(row, bench, others)
        small = _uncertainty(row, shift, bench, rows) if shift is not None else None
        if isinstance(wrong, tuple):
            exchanged.setdefault(tuple(name for name in benches if name in wrong), []).append(
                f"{_word(row.name)} of {row.run}"
            )
        elif wrong is not None:
            found.append(wrong)
        found += [small] if small else []
        if small:
            also = f"its u is {small.numbers['times']} times too small"
            verdict = also if verdict == "agrees" else f"{verdict}; {also}"
        judged.append(
            Reported(
                **{name: getattr(row, name) for name in Reported.__slots__[:7]},
                found=next(iter(bench.expected(row.name)), None),
                verdict=verdict or row.verdict,
            )
        )
    for pair, names in exchanged.items():
        words = {"runs": " and ".join(pair), "names": ", ".join(names)}
        found.insert(0, Found("reported_exchanged", words))
    return tuple(judged), by_severity(word(each) for each in found)


class _Bench:
    """A run with what its recording gives for each quantity."""

    def __init__(self, run: Run) -> None:
        self.run, motion = run, run.analysis.motion
        assert isinstance(motion, Oscillation)
        self.motion = motion

    def expected(self, name: str, period: Estimate | None = None) -> list[Estimate]:
        """Return what may be printed for a quantity, with the period of another run if it is given.

        For k that is also :math:`\\omega^2 m` of the bob alone, which leaves the mass of the spring out.
        """
        try:
            value = self.run[name]
        except KeyError:
            return []
        found = [Estimate(value.value, value.u, value.unit or "")]
        omega, mass = self.motion.derived.estimates["angular_frequency"], self.run.scene.bob_mass_kg
        if name == "spring_constant" and mass is not None:
            k = omega.value**2 * mass.value
            found.append(Estimate(k, k * math.hypot(2.0 * omega.u / omega.value, mass.u / mass.value), "N/m"))
        if period is None:
            return found
        ratio = (period.value / self.run["period"].value) ** PERIODIC[name]
        return [Estimate(each.value * ratio, each.u * ratio, each.unit) for each in found]

    def tolerance(self, row: Reported, scale: float, expected: Estimate) -> float:
        """Return how far a printed value may be off: its u, or that of reading it off a graph."""
        by_eye = STATED_ERROR_M / math.sqrt(2.0) if row.name == "amplitude" else 0.0
        if row.name in PERIODIC:
            by_eye = abs(PERIODIC[row.name] * expected.value) * READING_S / CYCLES / self.run["period"].value
        return APART * math.hypot(max(row.u * scale, by_eye), expected.u) + row.rounding * scale

    def with_echoes(self) -> float | None:
        """Return the recorded velocity over that of the motion, both root mean squares; None if none is recorded."""
        velocity = self.run.loaded.track.velocity
        if velocity is None or not np.isfinite(velocity).any():
            return None
        return float(np.sqrt(np.nanmean(np.square(velocity)))) / self.run["velocity_rms"].value


def _value(
    row: Reported, bench: _Bench, others: Sequence[_Bench]
) -> tuple[Found | tuple[str, ...] | None, str, float | None]:
    """Return the mistake in a value, or the two runs that were exchanged; the verdict; and the factor that mends it."""
    expected = bench.expected(row.name)
    if not expected:
        return None, "", None
    ours, about = expected[0], {"run": row.run, "name": _word(row.name), "printed": row.printed}
    about["ours"] = str(ours)
    if row.name == "noise":
        if 1.0 / TOO_SMALL < row.value / ours.value < TOO_SMALL:
            return None, "agrees", None
        return Found("reported_not_noise", about), "not the noise of a sample", None
    if row.name in ("damping_rate", "gamma") and bench.motion.damping.fits["linear"].rejection:
        if abs(row.value - ours.value) <= bench.tolerance(row, 1.0, ours):
            return None, "agrees", 1.0
        return Found("reported_not_exponential", about), "an exponential does not describe this decay", 1.0
    if (wrong := _echoes(row, bench, ours, about)) is not None:
        return wrong, "the velocities include false echoes", 1.0
    # A spring that nobody weighed makes k so uncertain that even exchanged values would agree: it counts last.
    unweighed = row.name == "spring_constant" and bench.run.scene.spring_mass_kg is None
    periods = [(other.run.name, other.expected("period")[0]) for other in others if row.name in PERIODIC]
    hypotheses = [("agrees", each) for each in expected[unweighed:]]
    hypotheses += [(name, each) for name, period in periods for each in bench.expected(row.name, period)[unweighed:]]
    hypotheses += [("agrees", each) for each in expected[:unweighed]]
    for name, each in hypotheses:
        if abs(row.value - each.value) <= bench.tolerance(row, 1.0, each):
            return (None, name, 1.0) if name == "agrees" else ((row.run, name), f"from the period of {name}", 1.0)
    for power in POWERS:
        scale = 10.0**power
        for _, each in hypotheses:
            off = abs(row.value * scale - each.value)
            if off <= max(bench.tolerance(row, scale, each), ROUGHLY * abs(each.value)) and off < 0.5 * abs(each.value):
                about["factor"] = f"{10 ** abs(power):,} times too {'small' if power > 0 else 'large'}"
                return Found("reported_power_of_ten", about), about["factor"], scale
    far = abs(row.value - ours.value) / math.hypot(max(row.u, row.rounding), ours.u)
    about["apart"] = f"{far:,.0f}" if far < 1e6 else "over a million"
    return Found("reported_differs", about), "differs", None


def _echoes(row: Reported, bench: _Bench, ours: Estimate, about: Mapping[str, str]) -> Found | None:
    """Return a finding if a velocity or Reynolds number is that of all samples, and false echoes are among them.

    Without recorded velocities a value that is too large is enough.
    """
    if row.name not in ("velocity_rms", "reynolds_number"):
        return None
    echoes, ratio, all_samples = (
        bench.run.result["quality"].get("false_echo", 0),
        row.value / ours.value,
        bench.with_echoes(),
    )
    near = all_samples is None or abs(ratio - all_samples) < 0.25 * (all_samples - 1.0)
    if not echoes or ratio < ECHOES or ratio - 1.0 < APART * ours.u / ours.value or not near:
        return None
    return Found("reported_false_echoes", {**about, "echoes": echoes, "ratio": ratio})


def _uncertainty(row: Reported, scale: float, bench: _Bench, rows: Sequence[Reported]) -> Found | None:
    """Return a finding if an uncertainty is smaller than what is sure to be in it.

    That is the u of the quantity that the report derives it from, by its own numbers; the u of this analysis, which
    uses every sample; and the difference of the value from this analysis.
    """
    if row.u <= 0.0:
        return None
    u, ours = row.u * scale, min(bench.expected(row.name), key=lambda each: each.u)
    needed = [*_derived(row, bench, rows), (ours.u, f"this analysis finds {ours}")]
    off = min(abs(row.value * scale - each.value) for each in bench.expected(row.name)) - row.rounding * scale
    if off > APART * math.hypot(u, ours.u) and off <= bench.tolerance(row, scale, ours):
        needed.append((off, f"this analysis finds {ours}"))
    least, words = max(needed)
    if u * TOO_SMALL > least:
        return None
    about = {"run": row.run, "name": _word(row.name), "printed": row.printed, "words": words}
    return Found("reported_u_too_small", {**about, "times": f"{least / u:,.0f}"})


def _derived(row: Reported, bench: _Bench, rows: Sequence[Reported]) -> Iterator[tuple[float, str]]:
    """Yield what the printed u of period, frequency or angular frequency make of the u of a row."""
    if row.name not in PERIODIC:
        return
    mass = bench.run.scene.bob_mass_kg
    for other in rows:
        if other.run != row.run or other.name not in PERIODIC or other.name in (row.name, "spring_constant"):
            continue
        relative = abs(PERIODIC[row.name]) * other.u / abs(other.value) if other.value else 0.0
        if row.name == "spring_constant" and mass is not None:
            relative = math.hypot(relative, mass.u / mass.value)
        u = relative * abs(row.value)
        yield u, f"the reported u of the {_word(other.name)} alone makes it {u:.2g}"


def _word(name: str) -> str:
    return QUANTITIES[name].label if name in QUANTITIES else name
