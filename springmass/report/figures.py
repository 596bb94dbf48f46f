"""Figures of a report: position and residuals, amplitude and laws, phase plot, energy.

Every function takes an analysis and returns a matplotlib ``Figure`` that belongs to no window. Colours are
those of Okabe and Ito, told apart by line style or marker as well. The same analysis gives the same bytes: no
dates, no random identifiers. Long series are thinned to what the eye can see or drawn as pixels inside the
vector file, so that the page stays small.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.analyse import Analysis, Motion
from pipeline.cycles import NoOscillation
from pipeline.track import F8, UNUSABLE, Quality
from springmass.report.tables import law_status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "NAMES",
    "amplitude_figure",
    "draw",
    "energy_figure",
    "has_error_bars",
    "is_long",
    "phase_figure",
    "position_figure",
    "render",
    "turn_step",
]

NAMES = ("position", "amplitude", "phase", "energy")

BLUE, SKY, ORANGE, GREEN, VERMILLION, PURPLE = (
    "#0072B2",
    "#56B4E9",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
)
GREY = "#7f7f7f"
# Bits of a sample, the gravest first; what they are called, and marker and colour.
_FLAGGED: tuple[tuple[int, str, str, str], ...] = (
    (int(Quality.CLIPPED), "clipped", "s", ORANGE),
    (int(Quality.FALSE_ECHO), "false echo", "x", VERMILLION),
    (int(UNUSABLE), "otherwise unusable", "+", GREEN),
)
_DASHES = ((0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
_SETTINGS: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.markerscale": 1.8,
    "lines.linewidth": 1.0,
    "path.simplify": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "springmass",
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
}
WIDTH = 7.2  # inches, as all lengths here
LEFT, RIGHT, BOTTOM = 0.72, 0.12, 0.45
ZOOM_PERIODS = 8
LONG_PERIODS = 14  # more than these are drawn whole and as a detail
DENSE_PERIODS = 40  # more than these are a band to the eye
DENSE_POINTS = 2500
LEAST_TURNS, MOST_TURNS = 4, 24  # drawn in a phase plot
VISIBLE_NOISE = 0.005  # of the panel's height; error bars of less vanish in the points


def draw(analysis: Analysis) -> dict[str, Figure]:
    """Return every figure of a run by name, in the report's order; the position alone of one at rest.

    Parameters
    ----------
    analysis : Analysis
    """
    if isinstance(analysis.motion, NoOscillation):
        return {"position": position_figure(analysis)}
    makers = (position_figure, amplitude_figure, phase_figure, energy_figure)
    return {name: make(analysis) for name, make in zip(NAMES, makers, strict=True)}


def render(figure: Figure, kind: Literal["svg", "pdf"]) -> bytes:
    """Return a figure as the bytes of a file, the same at every call.

    Parameters
    ----------
    figure : Figure
    kind : {"svg", "pdf"}
    """
    metadata = {
        "svg": {"Date": None, "Creator": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }
    out = io.BytesIO()
    with _style():
        figure.savefig(out, format=kind, metadata=metadata[kind])
    return out.getvalue()


def is_long(analysis: Analysis) -> bool:
    """Return whether the position is drawn twice, whole and as a detail of the first periods."""
    return isinstance(analysis.motion, Motion) and analysis.motion.cycles.count > LONG_PERIODS


def turn_step(motion: Motion) -> int:
    """Return one turn in how many the phase plot draws: the less the amplitude falls, the fewer turns."""
    amplitude = motion.demodulated.amplitude
    wanted = 32.0 * float(np.ptp(amplitude) / np.max(amplitude))
    return max(1, int(np.ceil(motion.cycles.count / min(max(wanted, LEAST_TURNS), MOST_TURNS))))


def has_error_bars(analysis: Analysis) -> bool:
    """Return whether the samples' error bars are large enough to be seen, and drawn."""
    y = analysis.track.y[(analysis.flags & UNUSABLE) == 0]
    return isinstance(analysis.motion, Motion) and bool(analysis.conditioned.noise_m > VISIBLE_NOISE * np.ptp(y))


def position_figure(analysis: Analysis) -> Figure:
    """Draw the distance with its fit, and beneath it the residual over the noise of one sample.

    Flagged samples have markers of their own; those off the axis stand at its edge. A long record is followed
    by a detail of its first periods. Where nothing oscillates the distance stands alone.

    Parameters
    ----------
    analysis : Analysis
    """
    track, motion = analysis.track, analysis.motion
    start, end = float(np.nanmin(track.t)), float(np.nanmax(track.t))
    with _style():
        if isinstance(motion, NoOscillation):
            figure, (only,) = _panels([(2.6, 0.0)])
            _draw_distance(only, analysis, start, end)
            _legend_above(only)
            only.set_xlabel("time / s")
            return figure
        long = is_long(analysis)
        rows = [(1.75, 0.0), (0.85, 0.08)]
        figure, axes = _panels([*rows, (1.9, 0.58), (0.85, 0.08)] if long else [(2.3, 0.0), (1.0, 0.08)])
        _draw_pair(axes[:2], analysis, motion, start, end)
        _legend_above(axes[0])
        if long:
            first = float(track.t[analysis.conditioned.used][0])
            last = first + ZOOM_PERIODS / motion.cycles.frequency_hz
            _draw_pair(axes[2:], analysis, motion, first, last)
            for panel in axes[:2]:
                panel.axvspan(first, last, color="#000000", alpha=0.07, lw=0)
            axes[2].set_title(f"the first {ZOOM_PERIODS} periods", loc="left", fontsize=8.5, pad=3)
        axes[-1].set_xlabel("time / s")
        return figure


def amplitude_figure(analysis: Analysis) -> Figure:
    """Draw the amplitudes with every law, and beneath them the selected law's residuals over their u.

    Parameters
    ----------
    analysis : Analysis
        Of a record that oscillates.
    """
    motion = _moving(analysis)
    damping, t, amplitude = motion.damping, motion.demodulated.t, motion.demodulated.amplitude * 1e3
    u, kept = damping.scatter.u * 1e3, damping.scatter.kept
    end = float(np.nanmax(analysis.track.t))
    grid = np.linspace(damping.t0, end, 240)
    with _style():
        figure, (above, below) = _panels([(2.7, 0.0), (1.0, 0.08)])
        _error_bars(above, t[kept], amplitude[kept], u[kept], "amplitude of one window")
        if not kept.all():
            above.plot(t[~kept], amplitude[~kept], "o", mfc="none", color=ORANGE, ms=4, label="left out of the fits")
        shown = [float(np.min(amplitude - u)), float(np.max(amplitude + u))]
        for i, name in enumerate(sorted(damping.fits, key=lambda name: name == damping.selected)):
            status = law_status(damping, name)
            chosen, rejected = name == damping.selected, status.startswith("rejected")
            colour = "#000000" if chosen else GREY if rejected else (GREEN, PURPLE, VERMILLION, ORANGE)[i % 4]
            style = "-" if chosen else _DASHES[i % len(_DASHES)]
            curve = damping.fits[name].amplitude(grid - damping.t0) * 1e3
            above.plot(grid, curve, color=colour, ls=style, lw=1.0, label=f"{name} ({status})", zorder=3)
        margin = 0.12 * max(shown[1] - shown[0], 1e-9)
        above.set_ylim(shown[0] - margin, shown[1] + margin)
        above.set_ylabel("amplitude / mm")
        residual = (amplitude - damping.best.amplitude(t - damping.t0) * 1e3) / np.where(u > 0, u, 1.0)
        below.plot(t[kept], residual[kept], "o", ms=2.6, mew=0, color=BLUE)
        below.plot(t[~kept], residual[~kept], "o", mfc="none", color=ORANGE, ms=4)
        _finish_residual(below, residual[kept], "residual / u")
        below.set_xlabel("time / s")
        _share(above, below, damping.t0, end)
        _legend_above(above, handle=2.8)
        return figure


def phase_figure(analysis: Analysis) -> Figure:
    """Draw the fitted velocity against the fitted displacement, and faintly what the samples say.

    Of many turns evenly spaced ones are drawn: see :func:`turn_step`.

    Parameters
    ----------
    analysis : Analysis
        Of a record that oscillates.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    motion, track = _moving(analysis), analysis.track
    period = 2.0 * np.pi / motion.phase.angular_frequency.value
    first, end = motion.damping.t0, float(np.nanmax(track.t))
    starts = np.arange(first, end, period * turn_step(motion))
    # The map's pale end would drown in the paper.
    colours = ListedColormap(colormaps["cividis"](np.linspace(0.0, 0.88, 64)))
    scale = Normalize(first, end)
    with _style():
        figure, (panel,) = _panels([(4.0, 0.0)], width=5.6, right=1.05)
        displacement, velocity, label = _measured_phase(analysis, motion)
        turn = np.floor((track.t - first) / period)
        drawn = np.isfinite(velocity) & (turn >= 0) & (np.mod(turn, turn_step(motion)) == 0)
        dots: dict[str, Any] = {
            "ms": 2.8,
            "mew": 0,
            "color": "#a0a0a0",
            "rasterized": np.count_nonzero(drawn) > DENSE_POINTS // 5,
        }
        fastest = 1.3 * float(np.nanmax(np.abs(motion.waveform.velocity)))
        beyond = int(np.count_nonzero(np.abs(velocity[drawn]) > fastest))
        label += f" ({beyond} off the axis)" if beyond else ""
        panel.plot(displacement[drawn] * 1e3, velocity[drawn], ".", label=label, **dots)
        panel.set_ylim(-fastest, fastest)
        for i, start in enumerate(starts):
            t = np.linspace(start, min(start + period, end), 73)
            x, v = _model_phase(motion, t)
            panel.plot(x * 1e3, v, color=colours(scale(start)), lw=1.0, label=None if i else "fitted motion")
        panel.set_xlabel("displacement / mm")
        panel.set_ylabel("velocity / (m/s)")
        _legend_above(panel)
        beside = panel.get_position()
        bar = figure.colorbar(
            ScalarMappable(scale, colours),
            cax=figure.add_axes((beside.x1 + 0.03, beside.y0, 0.025, beside.height)),
        )
        bar.set_label("time / s")
        bar.solids.set_rasterized(True)  # type: ignore[union-attr]  # a bar without lines always has them
        return figure


def energy_figure(analysis: Analysis) -> Figure:
    """Draw the mechanical energy with its band, from the amplitudes and from the selected law.

    Parameters
    ----------
    analysis : Analysis
        Of a record that oscillates. Without a mass in its scene the energy is that of one kilogram.
    """
    motion = _moving(analysis)
    damping, t = motion.damping, motion.demodulated.t
    mass = motion.derived.effective_mass_kg
    factor = 0.5e3 * (1.0 if mass is None else mass.value) * motion.phase.angular_frequency.value**2  # mJ
    amplitude, u = motion.demodulated.amplitude, damping.scatter.u
    energy = factor * amplitude**2
    end = float(np.nanmax(analysis.track.t))
    grid = np.linspace(damping.t0, end, 240)
    fitted = damping.best.amplitude(grid - damping.t0)
    curve, width = factor * fitted**2, 2.0 * factor * fitted * np.interp(grid, t, u)
    with _style():
        figure, (panel,) = _panels([(2.6, 0.0)])
        low, high = curve - width, curve + width
        label = "± one u of a window"
        panel.fill_between(grid, low, high, color=SKY, alpha=0.45, lw=0, label=label)
        panel.plot(t, energy, "o", ms=3.0, mew=0, color=BLUE, label="from the amplitudes")
        panel.plot(grid, curve, color="#000000", lw=1.0, label=f"from the law {damping.selected}", zorder=3)
        if 0 < min(float(np.min(energy)), float(np.min(low))) < float(np.max(energy)) / 20.0:
            panel.set_yscale("log")
            panel.yaxis.set_major_formatter("{x:g}")
        panel.set_ylabel("energy / mJ" if mass is not None else "energy per mass / (mJ/kg)")
        panel.set_xlabel("time / s")
        panel.set_xlim(damping.t0, end)
        _legend_above(panel)
        return figure


@contextmanager
def _style() -> Iterator[None]:
    from matplotlib import rc_context, rcdefaults, rcParams

    with rc_context():
        # A reader's own matplotlibrc must not change the report.
        rcdefaults()
        rcParams.update(_SETTINGS)
        yield


def _panels(
    rows: Sequence[tuple[float, float]], *, width: float = WIDTH, right: float = RIGHT, top: float = 0.12
) -> tuple[Figure, list[Axes]]:
    """Make panels under each other, each of a height and a gap above it in inches, left edges aligned."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height = BOTTOM + top + sum(sum(row) for row in rows)
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    axes, at = [], height - top
    for tall, gap in rows:
        at -= tall + gap
        panel = figure.add_axes((LEFT / width, at / height, (width - LEFT - right) / width, tall / height))
        panel.yaxis.set_label_coords(-0.5 / (width - LEFT - right), 0.5)
        axes.append(panel)
    return figure, axes


def _moving(analysis: Analysis) -> Motion:
    if isinstance(analysis.motion, NoOscillation):
        raise ValueError(f"only the position of this record can be drawn, nothing oscillates: {analysis.motion.why}")
    return analysis.motion


def _draw_pair(axes: Sequence[Axes], analysis: Analysis, motion: Motion, start: float, end: float) -> None:
    """Draw distance and fit above, residual over noise beneath, between two times."""
    above, below = axes
    t = analysis.track.t
    _draw_distance(above, analysis, start, end)
    law, rest = motion.damping.best, motion.rest
    if (end - start) * motion.cycles.frequency_hz > DENSE_PERIODS:
        grid = np.linspace(start, end, 400)
        reach = law.amplitude(grid - motion.damping.t0)
        for sign, label in ((1, "fit: rest ± amplitude"), (-1, None)):
            above.plot(grid, (rest.at(grid) + sign * reach) * 1e3, color="#000000", lw=1.0, label=label)
    else:
        grid = np.linspace(start, end, int(50 * (end - start) * motion.cycles.frequency_hz) + 2)
        position = rest.at(grid) + _model_phase(motion, grid)[0]
        above.plot(grid, position * 1e3, color="#000000", lw=0.8, label="fit", zorder=2.5)
    noise = analysis.estimates["noise"].value or 1.0
    inside = ((analysis.flags & UNUSABLE) == 0) & (t >= start) & (t <= end)
    residual = motion.waveform.residual[inside] / noise
    dense = residual.size > DENSE_POINTS
    size, alpha = (1.6, 0.5) if dense else (2.6, 1.0)
    below.plot(t[inside], residual, ".", ms=size, mew=0, color=BLUE, alpha=alpha, rasterized=dense)
    _finish_residual(below, residual, "residual / σ")
    _share(above, below, start, end)


def _draw_distance(panel: Axes, analysis: Analysis, start: float, end: float) -> None:
    """Draw the samples between two times, the flagged ones on top with markers of their own."""
    track, flags = analysis.track, analysis.flags
    inside = (track.t >= start) & (track.t <= end)
    y = track.y * 1e3
    used = inside & ((flags & UNUSABLE) == 0) & np.isfinite(y)
    if np.count_nonzero(used) > DENSE_POINTS:
        panel.plot(*_thinned(track.t[used], y[used], 900), color=SKY, lw=0.5, label="samples used")
    else:
        panel.plot(track.t[used], y[used], ".", ms=4.0, mew=0, color=SKY, label="samples used")
        if has_error_bars(analysis):
            u = analysis.conditioned.noise_m * 1e3
            panel.vlines(track.t[used], y[used] - u, y[used] + u, color=SKY, lw=0.6, alpha=0.6)
    # What was clipped off is part of the motion: the axis holds the fit as well as the samples.
    fit = analysis.motion.waveform.position[inside] * 1e3 if isinstance(analysis.motion, Motion) else y[used]
    shown = np.concatenate([y[used], fit[np.isfinite(fit)]])
    low, high = (float(np.min(shown)), float(np.max(shown))) if shown.size else (0.0, 1.0)
    margin = 0.1 * max(high - low, 6e3 * analysis.conditioned.noise_m, 1e-3)
    low, high = low - margin, high + margin
    rest = inside & ~used
    for bit, name, marker, colour in _FLAGGED:
        chosen = rest & np.isfinite(y) & ((flags & np.uint8(bit)) != 0)
        rest &= ~chosen
        if chosen.any():
            beyond = int(np.count_nonzero((y[chosen] < low) | (y[chosen] > high)))
            label = f"{name} ({np.count_nonzero(chosen)}" + (f"; {beyond} off the axis)" if beyond else ")")
            _mark(panel, track.t[chosen], np.clip(y[chosen], low, high), marker, colour, label)
    missing = rest & ~np.isfinite(y)
    if missing.any():
        count = int(np.count_nonzero(missing))
        _mark(panel, track.t[missing], np.full(count, low), "|", PURPLE, f"missing ({count})")
    panel.set_ylim(low, high)
    panel.set_xlim(start, end)
    panel.set_ylabel("position / mm")


def _mark(panel: Axes, t: F8, y: F8, marker: str, colour: str, label: str) -> None:
    """Set markers on top of everything, whole also at the edge."""
    style: dict[str, Any] = {"ms": 7 if marker == "|" else 3.2, "mew": 0.8, "color": colour, "ls": ""}
    panel.plot(t, y, marker, mfc="none", label=label, clip_on=False, zorder=4, **style)


def _legend_above(panel: Axes, *, handle: float = 1.5) -> None:
    """Put the legend above a figure's first panel, in as few rows as hold it, and make the paper as much taller."""
    figure = panel.get_figure(root=True)
    assert figure is not None
    # What was measured comes first, though matplotlib lists error bars last.
    entries = list(zip(*panel.get_legend_handles_labels(), strict=True))
    entries.sort(key=lambda entry: not entry[1].startswith(("samples", "amplitude")))
    handles, labels = [entry[0] for entry in entries], [entry[1] for entry in entries]
    rows = 1
    for rows in (1, 2, 3):
        legend = panel.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=-(-len(labels) // rows),
            borderaxespad=0.2,
            columnspacing=1.4,
            handletextpad=0.5,
            handlelength=handle,
        )
        if legend.get_window_extent().width <= panel.get_window_extent().width:
            break
    before = figure.get_figheight()
    after = before + 0.2 * rows
    for axes in figure.axes:
        at = axes.get_position()
        axes.set_position((at.x0, at.y0 * before / after, at.width, at.height * before / after))
    figure.set_figheight(after)


def _finish_residual(panel: Axes, residual: F8, label: str) -> None:
    reach = max(3.5, 1.1 * float(np.max(np.abs(residual), initial=0.0)))
    panel.set_ylim(-reach, reach)
    panel.axhline(0.0, color="#000000", lw=0.8)
    panel.set_ylabel(label)


def _share(above: Axes, below: Axes, start: float, end: float) -> None:
    below.sharex(above)
    above.tick_params(labelbottom=False)
    above.set_xlim(start, end)


def _error_bars(panel: Axes, t: F8, y: F8, u: F8, label: str) -> None:
    style: dict[str, Any] = {
        "fmt": "o",
        "ms": 3.4,
        "mew": 0,
        "color": SKY,
        "ecolor": BLUE,
        "elinewidth": 0.9,
        "capsize": 1.5,
    }
    panel.errorbar(t, y, yerr=u, label=label, **style)


def _model_phase(motion: Motion, t: F8) -> tuple[F8, F8]:
    """Fitted displacement and velocity at times t, m and m/s."""
    law, angle = motion.damping.best, motion.phase.total(t)
    amplitude = law.amplitude(t - motion.phase.t0)
    cosine, sine = np.cos(angle), np.sin(angle)
    velocity = -law.law.rate(amplitude, law.joint.values) * cosine - amplitude * motion.phase.rate(t) * sine
    return amplitude * cosine, velocity


def _measured_phase(analysis: Analysis, motion: Motion) -> tuple[F8, F8, str]:
    """Displacement and velocity of the samples used, NaN elsewhere: as recorded, or from both neighbours."""
    track = analysis.track
    used: NDArray[np.bool_] = (analysis.flags & UNUSABLE) == 0
    displacement = np.where(used, track.y - motion.rest.at(track.t), np.nan)
    if track.velocity is not None and np.isfinite(track.velocity).any():
        return displacement, np.where(used, track.velocity, np.nan), "samples, velocity as recorded"
    # Wider differences carry less noise; what they take from a sine is known and put back.
    omega = motion.phase.angular_frequency.value
    apart = max(1, round(2.0 * np.pi / omega * track.rate_hz / 16.0))
    velocity = np.full(track.t.size, np.nan)
    if track.t.size > 2 * apart:
        step = track.t[2 * apart :] - track.t[: -2 * apart]
        near = used[2 * apart :] & used[: -2 * apart] & (np.abs(step * track.rate_hz - 2 * apart) < 0.5)
        rise = (track.y[2 * apart :] - track.y[: -2 * apart])[near]
        velocity[apart:-apart][near] = rise * omega / (2.0 * np.sin(0.5 * omega * step[near]))
    return displacement, velocity, "samples, velocity from those around"


def _thinned(t: F8, y: F8, bins: int) -> tuple[F8, F8]:
    """Keep the least and the greatest of every bin: on paper of that many pixels nothing is lost."""
    edges = np.linspace(0, t.size, bins + 1).astype(np.int64)
    keep = [at + f(y[at:to]) for at, to in itertools.pairwise(edges) if to > at for f in (np.argmin, np.argmax)]
    rows = np.unique(np.array(keep, np.int64))
    return t[rows], y[rows]
