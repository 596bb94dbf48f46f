"""The charts of one run: motion, amplitude, frequency, spectrum, drag, energy, phase plot, contour, classic method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Oscillation, Relaxation
from pipeline.numerics.estimate import Estimate
from pipeline.numerics.levels import COVERAGE
from pipeline.numerics.regression import scatter
from pipeline.results.classic import CYCLES, Classic
from pipeline.results.curves import Curve
from pipeline.track import F8, UNUSABLE, Quality, Track
from pipeline.units import RECORDED_UNITS, noun
from springmass.charts.chart import (
    Chart,
    ChartNote,
    Panel,
    Role,
    Series,
    band_of,
    line_of,
    quantity_over,
    rate_label,
    value_label,
)
from springmass.typeset import LETTERS, law_status, pretty, pretty_number

REASONS: tuple[tuple[int, str], ...] = (
    (int(Quality.CLIPPED), "clipped: cut off at the end of the range"),
    (int(Quality.FALSE_ECHO), "false echo: far from where the motion puts the bob"),
    (int(Quality.DUPLICATE_TIME), "repeats an earlier time"),
    (int(Quality.NON_MONOTONIC_TIME), "runs backward in time"),
    (int(Quality.OUTSIDE), "outside the analysed part"),
    (int(UNUSABLE), "not usable"),
)
"""Bits of a sample's flags, the most serious first, and why such a sample is left out."""
EXPONENTIAL = "linear"
"""The law with which others are compared: linear drag."""
MOST_NAMED = 4  # laws with an entry of their own in the legend
DETAIL_PERIODS = 8
PER_PERIOD = 26  # points of a drawn period: a polygon that looks round
MOST_PERIODS_DRAWN = 460  # of more periods the envelope is drawn, which a screen cannot tell from the motion
MOST_STRETCHES, FEWEST_WINDOWS = 24, 6
MOST_TURNS = 8  # of the phase plot; more would cover one another
ONE_SIGMA = 0.6827  # probability of a normal deviate within one standard deviation
PER_TURN = 120  # points of a turn of the phase plot
MOST_SLIDING = 2000  # amplitudes of the classic method, which overlap


def position(a: Analysis, notes: Sequence[ChartNote] = ()) -> Chart:
    """Samples with their fit, residuals over the noise of one sample, and the rest position if it moves."""
    track, factor = a.track, RECORDED_UNITS[a.track.unit].factor
    rows = np.flatnonzero(np.isfinite(track.t))
    rows = rows[np.argsort(track.t[rows], kind="stable")]
    t, y, used = track.t[rows], track.y[rows] * factor, used_samples(a)[rows]
    out = np.flatnonzero(~used)
    why = tuple(_reason(int(a.flags[rows[i]]), y[i]) for i in out)
    if track.unit != "m":
        why = tuple(words.removeprefix("false echo: ").replace(" the bob", " it") for words in why)
    what = "position" if track.unit == "m" else noun(track.unit)
    samples = Series("samples used", t, np.where(used, y, np.nan))
    # A missing distance has no place; its time is marked at the middle of the others.
    middle = float(np.median(y[used])) if used.any() else 0.0
    places = np.where(np.isfinite(y[out]), y[out], middle)
    flagged = [Series(f"left out ({out.size})", t[out], places, "flagged", why=why)] if out.size else []
    series = [samples, *flagged, *_marks(notes)]
    noise, motion = a.estimates["noise"], a.motion
    sigma = pretty(Estimate(factor * noise.value, factor * noise.u, RECORDED_UNITS[track.unit].unit))
    if isinstance(motion, Relaxation):
        grid = np.linspace(motion.start_s, float(np.nanmax(track.t)), 600)
        series.insert(0, line_of("fit", grid, motion.position(grid) * factor))
    if not isinstance(motion, Oscillation):
        caption = f"The recording. Samples scatter by {sigma}."
        return Chart("position", "Position", caption, (Panel(value_label(what, track.unit), tuple(series)),))
    series[:0] = _fit_lines(a, motion, factor)
    residual = np.where(used, motion.waveform.residual[rows], np.nan) / (noise.value or 1.0)
    panels = [
        Panel(value_label(what, track.unit), tuple(series)),
        Panel("residual / σ", (Series("residual", t, residual),), 1.3, zero=True),
    ]
    if motion.rest.drifts:
        panels.append(_rest(a, motion, factor))
    cycles = motion.windows.cycles
    long = cycles.count > 2 * DETAIL_PERIODS
    end = float(t[used][0]) + DETAIL_PERIODS / cycles.frequency_hz if long else None
    caption = f"Samples and fit; below, residuals divided by the noise of one sample, σ = {sigma}."
    return Chart("position", "Position and residuals", caption, tuple(panels), end)


def recording(track: Track) -> Chart:
    """The samples alone, before anything is known of their motion."""
    what = "position" if track.unit == "m" else noun(track.unit)
    samples = line_of("samples", track.t, track.y * RECORDED_UNITS[track.unit].factor, "data")
    return Chart("recording", "Recording", "", (Panel(value_label(what, track.unit), (samples,), 1.3),))


def used_samples(a: Analysis) -> NDArray[np.bool_]:
    """Return which samples the analysis used."""
    return np.asarray(a.used & np.isfinite(a.track.y) & np.isfinite(a.track.t), np.bool_)


def _reason(flags: int, y: float) -> str:
    if not np.isfinite(y):
        return "missing: the sensor gave no value"
    return next((words for bit, words in REASONS if flags & bit), "not usable")


def _marks(notes: Sequence[ChartNote]) -> list[Series]:
    """Marks of the recording, its trigger and its losses, as vertical lines."""
    chosen = [note for note in notes if note.kind in ("mark", "trigger", "lost", "reopened")]
    at, texts = np.array([note.t_s for note in chosen]), (n.text if n.kind == "mark" else n.kind for n in chosen)
    return [Series("marks", at, np.full(at.size, np.nan), "mark", why=tuple(texts))] if chosen else []


def _fit_lines(a: Analysis, motion: Oscillation, factor: float) -> list[Series]:
    """The fitted motion where the recording was analysed, or its envelope if its periods are too many to draw."""
    inside = np.isfinite(a.track.t) & ((a.flags & Quality.OUTSIDE) == 0)
    start, end = float(np.min(a.track.t[inside])), float(np.max(a.track.t[inside]))
    periods = (end - start) * motion.windows.cycles.frequency_hz
    grid = np.linspace(start, end, int(PER_PERIOD * min(periods, MOST_PERIODS_DRAWN)) + 2)
    rest = motion.rest.at(grid)
    if periods <= MOST_PERIODS_DRAWN:
        return [line_of("fit", grid, (rest + model_motion(motion, grid)[0]) * factor)]
    reach = motion.damping.best.amplitude(grid - motion.damping.t0)
    return [line_of("fit: rest ± amplitude", grid, (rest + s * reach) * factor) for s in (1, -1)]


def model_motion(motion: Oscillation, t: F8) -> tuple[F8, F8]:
    """Return fitted displacement and velocity at times t, in the record's unit and in that unit per second."""
    law, angle = motion.damping.best, motion.phase.total(t)
    amplitude = law.amplitude(t - motion.phase.t0)
    cosine, sine = np.cos(angle), np.sin(angle)
    velocity = law.law.rate(amplitude, law.joint.values) * cosine - amplitude * motion.phase.rate(amplitude, t) * sine
    return amplitude * cosine, velocity


def _rest(a: Analysis, motion: Oscillation, factor: float) -> Panel:
    """Rest positions of the windows minus their mean, and the curve that was fitted to them."""
    rest, windows = motion.rest, motion.windows
    deviation = windows.offset - rest.mean.value
    grid = np.linspace(float(windows.t.min()), float(windows.t.max()), 400)
    curve = line_of("rest position, fitted", grid, (rest.at(grid) - rest.mean.value) * factor)
    points = Series(
        "rest of one window", windows.t, deviation * factor, u=np.sqrt(windows.covariance[:, 2, 2]) * factor
    )
    return Panel(value_label("rest", a.track.unit), (curve, points), 1.2)


def amplitude(a: Analysis, laws: Sequence[str] | None = None) -> Chart | None:
    """Amplitudes of the windows with the damping laws, and the selected law's residuals over u."""
    if (motion := a.oscillation) is None:
        return None
    damping, windows, factor = motion.damping, motion.windows, RECORDED_UNITS[a.track.unit].factor
    t, y, u, kept = windows.t, windows.amplitude * factor, damping.scatter.u * factor, damping.scatter.kept
    curves = _law_lines(a, laws)
    points = Series("amplitude of one window", t[kept], y[kept], u=u[kept])
    why = ("left out of the fits of the laws: far from its neighbours",) * int(np.count_nonzero(~kept))
    out = [] if kept.all() else [Series("left out of the fits", t[~kept], y[~kept], "flagged", why=why)]
    shown = kept if kept.any() else ~kept
    low, high = float(np.min((y - u)[shown])), float(np.max((y + u)[shown]))
    margin = 0.1 * max(high - low, 1e-9 * abs(high)) or 1.0
    residual = (y - damping.best.amplitude(t - damping.t0) * factor) / np.where(u > 0.0, u, 1.0)
    ends, log = (low - margin, high + margin), None if low <= 0.0 else False
    above = Panel(value_label("amplitude", a.track.unit), (*curves, points, *out), log=log, range=ends)
    below = Panel("residual / u", (Series("residual", t[kept], residual[kept]),), 1.3, zero=True)
    caption = "Amplitude of each window (one period or a few) ± u, with the damping laws; below, residuals of the law "
    return Chart("amplitude", "Amplitude and damping laws", f"{caption}{damping.selected} over u.", (above, below))


def _law_lines(a: Analysis, laws: Sequence[str] | None) -> list[Series]:
    """The selected law, the exponential and the best of the laws that cannot be ruled out; others without a name."""
    damping = a.damping
    grid = np.linspace(damping.t0, float(np.nanmax(a.track.t)), 160)
    named = list(laws or dict.fromkeys((damping.selected, *damping.admissible)))[: len(laws or ()) or MOST_NAMED]
    if laws is None and EXPONENTIAL in damping.fits and EXPONENTIAL not in named:
        named.append(EXPONENTIAL)
    unnamed = [] if laws else [name for name in damping.fits if name not in named]
    lines = []
    for name in (*unnamed, *sorted(named, key=lambda name: name != damping.selected)):
        words = "exponential, linear drag" if name == EXPONENTIAL else name
        together = name in unnamed and len(unnamed) > 1
        label = f"{len(unnamed)} other laws" if together else f"{words} ({law_status(damping, name)})"
        curve = damping.fits[name].amplitude(grid - damping.t0) * RECORDED_UNITS[a.track.unit].factor
        role: Role = "law" if name == damping.selected else "rest" if name in unnamed else "other"
        lines.append(line_of(label, grid, curve, role))
    return lines


_MODELS = {
    "constant": "model: one frequency",
    "amplitude": "model: the frequency depends on the amplitude",
    "time": "model: the frequency changes with time",
}


def frequency(a: Analysis) -> Chart | None:
    """Frequency of stretches of the run against their amplitude, with the model of the phase.

    In each stretch a straight line is fitted to the phases of its windows, weighted by their inverse variances. These
    include the scatter of the windows about a smooth curve and its correlation, or the misfit of all phases if that is
    larger.
    """
    if (motion := a.oscillation) is None or motion.windows.t.size < FEWEST_WINDOWS:
        return None
    phase, windows = motion.phase, motion.windows
    order = np.argsort(windows.t, kind="stable")
    own = windows.covariance[:, 1, 1]
    spread = scatter(windows.t, phase.residual, np.sqrt(own))
    variance = np.maximum(spread.u**2 * spread.correlation, own * max(phase.reduced_chi2, 1.0))
    points = []
    for part in np.array_split(order, min(MOST_STRETCHES, order.size // 2)):
        t, turned = windows.t[part], windows.phase[part]
        weight = 1.0 / np.maximum(variance[part], 1e-30)
        (slope, _), covariance = np.polyfit(t - t.mean(), turned, 1, w=np.sqrt(weight), cov="unscaled")
        points.append((float(np.mean(windows.amplitude[part])), slope, covariance[0, 0] ** 0.5))
    size, slope, u = np.array(sorted(points), np.float64).T
    factor, mean = RECORDED_UNITS[a.track.unit].factor, phase.angular_frequency.value
    shift = 1e3 / (2.0 * np.pi)
    by = "constant" if phase.bend is None else phase.bend.law.by
    grid = np.linspace(float(windows.t[order[0]]), float(windows.t[order[-1]]), 100)
    reach = np.clip(motion.damping.best.amplitude(grid - phase.t0), float(size[0]), float(size[-1]))
    law = line_of(_MODELS[by], reach * factor, shift * (phase.rate(reach, grid) - mean))
    stretches = Series("a stretch of the run", size * factor, shift * (slope - mean), u=shift * u)
    label = f"(frequency − {mean / (2.0 * np.pi):.5g} Hz) / mHz"
    panel = Panel(label, (law, stretches), x_label=value_label("amplitude", a.track.unit))
    behaviour = "is constant" if phase.bend is None else "changes"
    caption = f"Frequency of stretches of the run ± u; in the fitted model it {behaviour}."
    return Chart("frequency", "Frequency against amplitude", caption, (panel,))


def spectrum(a: Analysis) -> Chart | None:
    """Amplitude spectra of the recording and of the residuals of its fit, with the highest peaks."""
    if (motion := a.oscillation) is None or (spectra := spectrum_of(a, motion)) is None:
        return None
    f, whole, left = spectra
    factor, best = RECORDED_UNITS[a.track.unit].factor, peaks_of(whole)
    floor = float(np.median(left[left > 0])) if (left > 0).any() else float(whole.max()) * 1e-6
    lines = (
        line_of("residuals of the fit", f, left * factor, "other"),
        Series("recording", f, whole * factor, line=True),
        Series("peaks", f[best], whole[best] * factor, "mark", why=tuple(f"{f[i]:.3g} Hz" for i in best)),
    )
    ends = (floor * factor / 20.0, float(whole.max()) * factor * 8.0)
    panel = Panel(value_label("amplitude", a.track.unit), lines, x_label="frequency / Hz", log=True, range=ends)
    caption = "Amplitude spectra (Hann window). A peak of the residuals is a motion that the fit does not describe."
    return Chart("spectrum", "Spectrum", caption, (panel,))


def drag(a: Analysis) -> Chart | None:
    """Effective drag coefficient against amplitude, if scene and recording determine it."""
    unit = a.track.unit
    if (curve := a.drag_curve()) is None:
        return None
    # The long error bar of a stretch with hardly any damping would compress everything else.
    most = 2.5 * float(np.max(np.abs(curve.y) + curve.u))
    both = ((curve.y, curve.u), (curve.y_points, curve.u_points))
    ends = np.clip(np.concatenate([y + sign * u for y, u in both for sign in (-1, 1)]), -most, most)
    low, high = min(0.0, float(np.min(ends))), float(np.max(ends))
    series = _with_band(curve, RECORDED_UNITS[unit].factor, 1.0, "a stretch of the run", f"law {a.damping.selected}")
    shown = (low, high + 0.08 * (high - low))
    panel = Panel("effective drag coefficient", series, 3.0, value_label("amplitude", unit), range=shown)
    caption = (
        "−dA/dt · 3π M/(2 ω ρ S A²), M the mass that swings: the coefficient of purely quadratic drag on the disc with "
        "the same energy loss, that of the spring included. Where it depends on the amplitude, a constant does not "
        "describe the drag."
    )
    return Chart("drag", "Effective drag coefficient", caption, (panel,))


def _with_band(curve: Curve, x: float, y: float, points: str, law: str) -> tuple[Series, ...]:
    return (
        band_of("± u of the law", x * curve.x, y * curve.y, y * curve.u),
        line_of(law, x * curve.x, y * curve.y),
        Series(points, x * curve.x_points, y * curve.y_points, u=y * curve.u_points),
    )


def energy(a: Analysis) -> Chart | None:
    """Mechanical energy with its band, and the deviation of single amplitudes from the law."""
    if (curve := a.energy_curve()) is None:
        return None
    low, high = float(np.min(curve.y - curve.u)), float(np.max(curve.y))
    law = np.interp(curve.x_points, curve.x, curve.y)
    # Where friction has stopped the motion, the law predicts no energy for comparison.
    there, moves = law > 0.0, curve.y > 0.0
    off = 100.0 * (curve.y_points[there] / law[there] - 1.0)
    width = 100.0 * curve.u[moves] / curve.y[moves]
    label = "energy / mJ" if curve.unit == "J" else "energy per mass / (mJ/kg)"
    series = _with_band(curve, 1.0, 1e3, "from single amplitudes", f"law {a.damping.selected}")
    above = Panel(label, series, 2.6, log=low < high / 20.0 if low > 0.0 else None)
    band = band_of("± u of the law", curve.x[moves], np.zeros(width.size), width)
    points = Series("deviation", curve.x_points[there], off, u=100.0 * curve.u_points[there] / law[there])
    below = Panel("deviation / %", (band, points), 1.3, zero=True)
    mass = a.derived.effective_mass_kg
    of = f"the mass that oscillates, {pretty(mass)}" if mass is not None else "one kilogram, as no mass was given"
    caption = f"Energy M ω² A²/2 of {of}; below, the deviation of single amplitudes from the law."
    return Chart("energy", "Energy", caption, (above, below))


def motion(a: Analysis) -> Chart | None:
    """Velocity and acceleration, and the difference of the velocity from the fitted law in its band of u."""
    smoothed, fit, unit = a.smoothed, a.oscillation, a.track.unit
    if smoothed is None or fit is None or unit not in ("m", "rad"):
        return None
    rows = np.flatnonzero(np.isfinite(smoothed.position))
    if not rows.size:
        return None
    rows = rows[np.argsort(smoothed.t[rows], kind="stable")]
    rows = rows[:: max(1, round(a.track.rate_hz / fit.windows.cycles.frequency_hz / PER_PERIOD))]
    t, velocity, u = smoothed.t[rows], smoothed.velocity[rows], smoothed.u_velocity[rows]
    names = ("velocity", "acceleration") if unit == "m" else ("derivative", "2nd derivative")
    k = RECORDED_UNITS[unit].factor
    off = k * (velocity - model_motion(fit, t)[1])
    band = rows.size // 400 + 1  # u changes slowly
    first = [line_of(names[0], t, velocity)]
    if a.track.velocity is not None:
        first.append(Series("as recorded", t, np.where(used_samples(a), a.track.velocity, np.nan)[rows]))
    around = band_of(f"± u of the {names[0]}", t[::band], np.zeros(t[::band].size), k * u[::band])
    label = "v − law / (mm/s)" if unit == "m" else rate_label("deviation", 1, unit)
    panels = (
        Panel(rate_label(names[0], 1, unit), tuple(first)),
        Panel(rate_label(names[1], 2, unit), (line_of(names[1], t, smoothed.acceleration[rows]),), 1.6),
        Panel(label, (around, line_of(f"{names[0]} − law", t, off)), 1.3, zero=True),
    )
    caption = (
        f"{names[0].capitalize()} and {names[1]} from the fit, not by differences of neighbours; below, the "
        f"difference from the fitted law, with ±u. motion.csv holds them with their uncertainties at every sample."
    )
    end = float(t[0]) + DETAIL_PERIODS / fit.windows.cycles.frequency_hz
    return Chart("motion", "Velocity and acceleration", caption, panels, end if end < t[-1] else None)


def phase(a: Analysis) -> Chart | None:
    """Velocity against displacement: turns of the fitted motion spread over the run, and recorded velocities."""
    if (motion := a.oscillation) is None:
        return None
    track, unit = a.track, a.track.unit
    factor, period = RECORDED_UNITS[unit].factor, 2.0 * np.pi / motion.phase.angular_frequency.value
    inside = (a.flags & Quality.OUTSIDE) == 0
    first, end = motion.damping.t0, float(np.nanmax(track.t[inside]))
    turns = max(int((end - first) / period), 1)
    drawn = np.unique(np.linspace(0, turns - 1, MOST_TURNS).round())
    series, fastest = [], 0.0
    for start in (first + period * drawn).tolist():
        displacement, velocity = model_motion(motion, np.linspace(start, min(start + period, end), PER_TURN))
        series.append(line_of(f"turn at {start:.3g} s", displacement * factor, velocity, "time"))
        fastest = max(fastest, 1.1 * float(np.nanmax(np.abs(velocity))))
    if track.velocity is not None:
        turn = np.floor((track.t - first) / period)
        seen = used_samples(a) & np.isfinite(track.velocity) & np.isin(turn, drawn)
        displacement = (track.y - motion.rest.at(track.t)) * factor
        series.insert(0, Series("samples, velocity as recorded", displacement[seen], track.velocity[seen], "rest"))
    label = rate_label("velocity" if unit == "m" else "derivative", 1, unit)
    x_label = value_label("displacement" if unit == "m" else f"{noun(unit)} from rest", unit)
    panel = Panel(label, tuple(series), 4.4, x_label, equal=True, range=(-fastest, fastest))
    some = f" {drawn.size} of {turns} turns are drawn." if drawn.size < turns else ""
    return Chart("phase", "Phase plot", f"Velocity against displacement from rest.{some}", (panel,))


def contour(a: Analysis) -> Chart | None:
    """Regions of the two parameters of the selected law that are correlated most."""
    if (found := a.contour((COVERAGE, ONE_SIGMA))) is None:
        return None
    x, y = (LETTERS.get(name, name) for name in found.names)
    borders = found.ellipses if found.profiles is None else found.profiles
    drawn: list[tuple[str, Role, F8]] = [("95 %", "data", borders[0]), ("68 %", "law", borders[1])]
    if found.profiles is not None:
        drawn += [(f"{p} %, by the covariance", "other", e) for p, e in zip((95, 68), found.ellipses, strict=True)]
    lines = [line_of(label, border[:, 0], border[:, 1], role) for label, role, border in drawn]
    series = (*lines, Series("best fit", found.centre[:1], found.centre[1:], "mark", why=("",)))
    label, x_label = quantity_over(y, found.units[1]), quantity_over(x, found.units[0])
    caption = (
        f"Regions that hold {x} and {y} of the law {a.damping.selected} together with these probabilities, from the "
        f"scatter of the recording (type A). Their correlation is {pretty_number(found.correlation, 3)}."
    )
    if found.profiles is not None:
        caption += " Solid: from the profile of χ², which is no parabola here."
    return Chart("contour", "Contour of two parameters", caption, (Panel(label, series, 4.4, x_label, equal=True),))


def classic_method(a: Analysis, classic: Classic) -> Chart | None:
    """The lab report's choices over this analysis: two maxima, two extremes, sliding windows and their exponential."""
    if (ours := amplitude(a, [a.damping.selected])) is None:
        return None
    factor, period = RECORDED_UNITS[a.track.unit].factor, classic.estimates["period"].value
    start, end = (float(classic.crests_t[i]) + s * 0.75 * period for i, s in ((0, -1), (-1, 1)))
    near = np.flatnonzero(used_samples(a) & (a.track.t >= start) & (a.track.t <= end))
    if not near.size:
        return None
    chosen = np.array([0, CYCLES])
    picked = f"picked maxima, {CYCLES} periods apart"
    t, y = classic.crests_t[chosen], classic.crests_y[chosen] * factor
    extremes = [factor * each for _, each in classic.extremes]
    span = np.array([a.track.t[near[0]], a.track.t[near[-1]]])
    picks = (
        Series("samples used", a.track.t[near], a.track.y[near] * factor),
        Series(picked, t, y, "mark", why=("", "")),
        *(line_of("extremes of the whole recording", span, np.full(2, x), "other") for x in extremes),
    )
    above = Panel(value_label("position", a.track.unit), picks, x_label="time of the picked maxima / s")
    every = slice(None, None, classic.window_t.size // MOST_SLIDING + 1)
    times, amplitudes = classic.window_t[every], factor * classic.window_amplitude[every]
    sliding = line_of("half the range in 1.5 s", times, amplitudes, "other")
    fitted = line_of("its exponential", times, factor * classic.exponential()[every], "other")
    both = np.concatenate([sliding.y, fitted.y])
    ends = (float(np.min(both)), 1.05 * float(np.max(both)))
    below = Panel(ours.panels[0].label, (*ours.panels[0].series, sliding, fitted), range=ends)
    caption = (
        "The lab report's method on this recording, for comparison only. Above, its maxima and extremes; below, half "
        "the range within 1.5 s of every sample and its exponential, with the amplitudes and the law of this analysis."
    )
    return Chart("classic", "The lab report's method", caption, (above, below))


CHARTS: Mapping[str, Callable[[Analysis], Chart | None]] = {
    "position": position,
    "amplitude": amplitude,
    "frequency": frequency,
    "spectrum": spectrum,
    "drag": drag,
    "energy": energy,
    "motion": motion,
    "phase": phase,
    "contour": contour,
}
"""The charts of a run by name, in the report's order; the classic method needs its own analysis."""


def charts_of(
    a: Analysis, notes: Sequence[ChartNote] = (), classic: Classic | None = None, *, profiles: bool = False
) -> dict[str, Chart]:
    """Return all charts that a run allows, in the report's order; only the position if nothing oscillates.

    ``profiles`` asks for the contour too, which may take as long as the analysis.
    """
    makers: dict[str, Callable[[Analysis], Chart | None]] = {**CHARTS, "position": partial(position, notes=notes)}
    charts = {name: make(a) for name, make in makers.items() if profiles or name != "contour"}
    if classic is not None:
        charts["classic"] = classic_method(a, classic)
    return {name: chart for name, chart in charts.items() if chart is not None}


SHOWN_MULTIPLES = 8.0  # range of the spectrum in multiples of the oscillation's frequency
LEAST_ROWS = 8
MOST_PEAKS, MOST_TRIED = 5, 200
PEAK_FALSE_ALARM = 1e-3  # probability that white noise has a labelled peak
SURROUNDINGS = 101  # rows whose median is the noise level around a peak
PEAK_SPACING = 0.03  # of the range of frequencies; of two peaks that are nearer, the higher is labelled


def spectrum_of(a: Analysis, motion: Oscillation) -> tuple[F8, F8, F8] | None:
    """Return frequencies in Hz, and the amplitudes of recording and residuals in the recording's unit.

    The discrete Fourier transform with a Hann window is scaled so that a steady sinusoid shows its amplitude. Omitted
    samples and gaps are filled with the fit in the recording, and with zero in the residuals.
    """
    track, waveform = a.track, motion.waveform
    used = used_samples(a) & np.isfinite(waveform.residual)
    start, end = float(track.t[used][0]), float(track.t[used][-1])
    count = max(round((end - start) * track.rate_hz) + 1, 8)
    grid = np.linspace(start, end, count)
    at = np.clip(np.round((track.t[used] - start) / (end - start) * (count - 1)).astype(np.intp), 0, count - 1)
    residual = np.zeros(count)
    residual[at] = waveform.residual[used]
    swing = motion.damping.best.amplitude(grid - motion.phase.t0) * np.cos(motion.phase.total(grid))
    whole = motion.rest.at(grid) + swing
    whole[at] = track.y[used]
    window = np.hanning(count)
    scale = 2.0 / window.sum()
    f: F8 = np.asarray(np.fft.rfftfreq(count, 1.0 / track.rate_hz), np.float64)
    keep = (f > 0.0) & (f <= SHOWN_MULTIPLES * motion.windows.cycles.frequency_hz)
    if np.count_nonzero(keep) < LEAST_ROWS:
        return None
    whole, residual = (scale * np.abs(np.fft.rfft(window * (y - y.mean())))[keep] for y in (whole, residual))
    return f[keep], whole, residual


def peaks_of(amplitude: F8) -> list[int]:
    """Return the rows of the highest peaks that exceed the noise around them.

    The amplitudes of white noise have a Rayleigh distribution: with probability :math:`\\alpha`, the largest of n
    exceeds :math:`\\sqrt{\\ln(n/\\alpha)/\\ln 2}` times their median.
    """
    limit = np.sqrt(np.log(amplitude.size / PEAK_FALSE_ALARM) / np.log(2.0))
    inner = amplitude[1:-1]
    # scipy has functions for both, but they take longer to import than all charts take to make.
    tops = np.flatnonzero((inner > amplitude[:-2]) & (inner >= amplitude[2:])) + 1
    taken: list[int] = []
    for row in tops[np.argsort(amplitude[tops])[::-1]][:MOST_TRIED].tolist():
        noise = float(np.median(amplitude[max(row - SURROUNDINGS // 2, 0) : row + SURROUNDINGS // 2 + 1]))
        alone = all(abs(row - other) > PEAK_SPACING * amplitude.size for other in taken)
        if len(taken) < MOST_PEAKS and alone and amplitude[row] > limit * max(noise, 1e-30):
            taken.append(row)
    return taken
