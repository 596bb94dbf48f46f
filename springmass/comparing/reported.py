"""Check values that somebody printed about runs against the recordings, and name the mistake that explains them."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation

import numpy as np

from acquisition.units import measure_of, time_unit
from pipeline.findings.finding import Finding, by_severity, word
from pipeline.notice import Notice
from pipeline.numerics.estimate import Estimate
from pipeline.quantities import QUANTITIES
from pipeline.results.classic import CYCLES, READING_S, STATED_ERROR_M
from springmass.comparing.user_table import Row, read_rows
from springmass.errors import ProgramError
from springmass.runs.run import Run

REPORTED_COLUMNS = ("run", "name", "value", "u", "unit")
DIFFERENT_U = 4.0  # differences beyond so many standard uncertainties are no chance
TOO_SMALL = 3.0  # an uncertainty is too small if what is sure to be in it is so many times larger: one digit is printed
POWERS = sorted(range(-6, 7), key=abs)[1:]
ROUGHLY = 0.05  # of a value with a wrong power of ten, which may be off otherwise too
ECHOES = 1.05  # least ratio of a velocity with false echoes to that of the motion
PERIODIC = {"period": 1, "frequency": -1, "angular_frequency": -1, "spring_constant": -2}
"""Quantities that follow from the period, each with the power of the period."""
_NAMES = {each: q.name for q in QUANTITIES.values() for each in (q.symbol, q.page_symbol.replace(" ", "_"), q.name)}
_NAMES |= {"A": "amplitude", "w": "angular_frequency", "v": "velocity_rms", "sensor_error": "noise"}
_SAME = {"rad/s": ("1/s", "s^-1"), "1/s": ("s^-1",), "N/m": ("kg/s^2",)}
"""Units as they are printed for the unit of a result."""


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
    found: Estimate | None = None
    verdict: str = "not compared: the recording gives no such value"


def read_reported(path: str | os.PathLike[str], runs: Sequence[Run]) -> list[Reported]:
    """Read a table with the columns run, name, value, u, unit; errors name the line and what to write."""
    head, rows = read_rows(path, "table")
    if not {"run", "name", "value"} <= set(head):
        raise ProgramError(f"{path}: expected the columns {', '.join(REPORTED_COLUMNS)}, got {', '.join(head)}")
    return [_row(row, runs) for row in rows]


def _row(row: Row, runs: Sequence[Run]) -> Reported:
    where, text, numbers = row.where, dict.fromkeys(REPORTED_COLUMNS, "") | dict(row.cells), {}
    for column, empty in (("value", "nan"), ("u", "0")):
        try:
            number = Decimal(row.plain(column) or empty)
        except InvalidOperation:
            number = Decimal("nan")
        if not (number.is_finite() and abs(number.adjusted()) < 100) or (column == "u" and number < 0):
            raise ProgramError(f"{where}: {column} must be a number such as 14.0 or 1e-3, got {text[column]!r}")
        numbers[column] = number
    names = [run.name for run in runs]
    begun = [name for name in names if name.lower().startswith(text["run"].lower())]
    of = [text["run"]] if text["run"] in names else begun
    if len(of) != 1:
        raise ProgramError(f"{where}: {text['run']!r} must be one of {', '.join(names)}, or its beginning")
    name, unit = _NAMES.get(text["name"], text["name"]), text["unit"]
    (recorded,) = (run.loaded.track.unit for run in runs if run.name == of[0])
    si = QUANTITIES[name].unit_in(recorded) if name in QUANTITIES else unit
    factor = 1.0
    if unit and unit != si and unit not in _SAME.get(si, ()):
        measure = time_unit(unit) if si == "s" else measure_of(unit)
        if measure is None or measure.si != si:
            raise ProgramError(f"{where}: {unit!r} is no unit of {_word(name)}", f"give {si or 'none'}")
        factor = float(10.0**measure.power * measure.factor)
    rounding = 0.5 * 10.0 ** float(numbers["value"].as_tuple().exponent)
    printed = " ".join(filter(None, [text["value"], text["u"] and f"+- {text['u']}", unit]))
    value, u = (float(numbers[column]) * factor for column in ("value", "u"))
    return Reported(of[0], name, printed, value, u, rounding * factor)


def judge(rows: Sequence[Reported], runs: Sequence[Run]) -> tuple[tuple[Reported, ...], tuple[Finding, ...]]:
    """Return each row with its verdict, and a finding for each mistake, the most severe first."""
    by_name = {run.name: run for run in runs}
    judged: list[Reported] = []
    mistakes: list[Notice] = []
    exchanged: dict[str, list[str]] = {}
    for row in rows:
        run = by_name[row.run]
        others = {name: other for name, other in by_name.items() if name != row.run}
        expected = _expected(run, row.name)
        if not expected:
            judged.append(row)
            continue
        verdict, wrong, scale = _value(row, run, others)
        if verdict in others:
            pair = " and ".join(name for name in by_name if name in (row.run, verdict))
            exchanged.setdefault(pair, []).append(f"{_word(row.name)} of {row.run}")
            verdict = f"from the period of {verdict}"
        small = _uncertainty(row, scale, run, rows) if scale is not None and row.u > 0.0 else None
        if small is not None:
            also = f"its u is {small.numbers['times']} times too small"
            verdict = also if verdict == "agrees" else f"{verdict}; {also}"
        mistakes += [each for each in (wrong, small) if each is not None]
        judged.append(replace(row, found=expected[0], verdict=verdict))
    mixed = [Notice("reported_exchanged", {"runs": p, "names": ", ".join(each)}) for p, each in exchanged.items()]
    return tuple(judged), by_severity(word(each) for each in (*mixed, *mistakes))


def _expected(run: Run, name: str, period: Estimate | None = None) -> list[Estimate]:
    """Return what may be printed for a quantity, with the period of another run if it is given.

    For k that is also :math:`\\omega^2 m` of the bob alone, which leaves the mass of the spring out.
    """
    if name not in run and name != "gamma":
        return []
    estimates = [run[name if name in run else "damping_rate"]]
    omega, mass = run["angular_frequency"], run.scene.bob_mass_kg
    if name == "spring_constant" and mass is not None:
        k = omega.value**2 * mass.value
        estimates.append(Estimate(k, k * math.hypot(2.0 * omega.u / omega.value, mass.u / mass.value), "N/m"))
    ratio = 1.0 if period is None else (period.value / run["period"].value) ** PERIODIC[name]
    return [Estimate(each.value * ratio, each.u * ratio, each.unit) for each in estimates]


def _agrees(run: Run, row: Reported, expected: Estimate, scale: float = 1.0, roughly: float = 0.0) -> bool:
    """Tell whether a printed value is within its u, or that of reading it off a graph, of an expected one."""
    by_eye = STATED_ERROR_M / math.sqrt(2.0) if row.name == "amplitude" and expected.unit == "m" else 0.0
    if row.name in PERIODIC:
        by_eye = abs(PERIODIC[row.name] * expected.value) * READING_S / CYCLES / run["period"].value
    allowed = DIFFERENT_U * math.hypot(max(row.u * scale, by_eye), expected.u) + row.rounding * scale
    return abs(row.value * scale - expected.value) <= max(allowed, roughly * abs(expected.value))


def _value(row: Reported, run: Run, others: Mapping[str, Run]) -> tuple[str, Notice | None, float | None]:
    """Return the verdict on a value, or the run that it was exchanged with; the mistake; and the factor that mends it.

    The factor is None where the uncertainty of the value cannot be judged.
    """
    expected = _expected(run, row.name)
    ours = expected[0]
    about = {"run": row.run, "name": _word(row.name), "printed": row.printed, "ours": str(ours)}
    if row.name == "noise":
        if ours.value < TOO_SMALL * row.value and row.value < TOO_SMALL * ours.value:
            return "agrees", None, None
        return "not the noise of one sample", Notice("reported_not_noise", about), None
    linear = run.analysis.damping.fits.get("linear")
    if row.name in ("damping_rate", "gamma") and linear is not None and linear.rejection:
        if _agrees(run, row, ours):
            return "agrees", None, 1.0
        return "an exponential does not describe this decay", Notice("reported_not_exponential", about), 1.0
    if (echoes := _echoes(row, run, ours)) is not None:
        verdict = f"the velocities {echoes['include']} false echoes"
        return verdict, Notice("reported_false_echoes", {**about, **echoes}), 1.0
    # A spring that nobody weighed makes k so uncertain that even exchanged values would agree: it counts last.
    unweighed = row.name == "spring_constant" and run.scene.spring_mass_kg is None
    hypotheses = [("agrees", each) for each in expected[unweighed:]]
    for name, other in others.items() if row.name in PERIODIC else ():
        hypotheses += [(name, each) for each in _expected(run, row.name, _expected(other, "period")[0])[unweighed:]]
    for name, each in (*hypotheses, *(("agrees", each) for each in expected[:unweighed])):
        if _agrees(run, row, each):
            nearest = min(expected, key=lambda x: abs(row.value - x.value))
            alone = name == "agrees" and nearest is not ours and not unweighed
            return "agrees without the mass of the spring" if alone else name, None, 1.0
    for power in POWERS:
        if any(_agrees(run, row, each, 10.0**power, ROUGHLY) for _, each in hypotheses):
            about["factor"] = f"{10 ** abs(power):,} times too {'small' if power > 0 else 'large'}"
            return about["factor"], Notice("reported_power_of_ten", about), 10.0**power
    far = abs(row.value - ours.value) / math.hypot(max(row.u, row.rounding), ours.u)
    about["apart"] = f"{far:,.0f}" if far < 1e6 else "over a million"
    return "differs", Notice("reported_differs", about), None


def _echoes(row: Reported, run: Run, ours: Estimate) -> dict[str, float | str] | None:
    """Return the number of false echoes and the ratio to this analysis if a velocity or Re is that of all samples.

    Recorded velocities prove it; without them a value that is too large is only perhaps theirs.
    """
    echoes, velocity = run.result["quality"].get("false_echo", 0), run.loaded.track.velocity
    if row.name not in ("velocity_rms", "reynolds_number") or not echoes or ours.value <= 0.0:
        return None
    ratio = row.value / ours.value
    if ratio < ECHOES or _agrees(run, row, ours):
        return None
    include = "perhaps include"
    if velocity is not None and np.isfinite(velocity).any():
        include = "include"
        whole = float(np.sqrt(np.nanmean(np.square(velocity)))) / run["velocity_rms"].value
        if abs(ratio - whole) > 0.25 * (whole - 1.0):
            return None
    return {"echoes": echoes, "ratio": ratio, "include": include}


def _uncertainty(row: Reported, scale: float, run: Run, rows: Sequence[Reported]) -> Notice | None:
    """Return a finding if an uncertainty is smaller than what is sure to be in it.

    That is the u of the quantity that the report derives it from, by its own numbers; the u of this analysis, which
    uses every sample; and the difference of the value from this analysis.
    """
    u, expected = row.u * scale, _expected(run, row.name)
    ours = min(expected, key=lambda each: each.u)
    needed = [(ours.u, f"this analysis finds {ours}")]
    nearest = min(expected, key=lambda each: abs(row.value * scale - each.value))
    off = abs(row.value * scale - nearest.value) - row.rounding * scale
    if off > DIFFERENT_U * math.hypot(u, nearest.u) and _agrees(run, row, nearest, scale):
        needed.append((off, f"this analysis finds {nearest}"))
    mass = run.scene.bob_mass_kg
    for other in rows if row.name in PERIODIC else ():
        if other.run == row.run and other.name in PERIODIC and other.name not in (row.name, "spring_constant"):
            relative = abs(PERIODIC[row.name]) * other.u / abs(other.value) if other.value else 0.0
            if row.name == "spring_constant" and mass is not None:
                relative = math.hypot(relative, mass.u / mass.value)
            least = relative * abs(row.value)
            needed.append((least, f"the reported u of the {_word(other.name)} alone makes it {least:.2g}"))
    least, words = max(needed)
    if u * TOO_SMALL > least:
        return None
    about = {"run": row.run, "name": _word(row.name), "printed": row.printed, "words": words}
    return Notice("reported_u_too_small", {**about, "times": f"{least / u:,.0f}"})


def _word(name: str) -> str:
    return QUANTITIES[name].label if name in QUANTITIES else name
