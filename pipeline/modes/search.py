"""The search for modes beside the main oscillation, which make its amplitude and phase beat."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.modes.mode import Carrier, Mode, Modes
from pipeline.modes.spectrum import (
    Blocks,
    Peak,
    SearchBand,
    evidence_for,
    spectral_density,
    strongest,
    worth_a_look,
)
from pipeline.numerics.levels import ROUNDS, SIGNIFICANT
from pipeline.numerics.regression import beyond
from pipeline.numerics.robust import mad_sigma
from pipeline.samples.condition import Samples
from pipeline.track import C16, F8
from pipeline.windows.demodulate import Windows

# Multiples of the main frequency that bent scales and springs cause; they share the probability CHANCE.
HARMONICS = (2, 3)
CHANCE = 0.005  # probability that a mode is found in a record without any; as much again for a harmonic
# Maximum degree of the polynomial for a mode's amplitude and phase. With 3, damping rates beside a mode move by 0.4 u,
# as measured by `python -m tests.golden --only damped`.
ENVELOPE = 4
# Minimum number of windows; fewer cannot separate a mode from the main oscillation. With 5, edges of a clipped signal
# count as modes (`python -m tests.golden --only n0.csv`), and with 8, one of eight periods goes (`--only Q1.txt`).
LEAST_WINDOWS = 6
# Ratio to the main frequency below which modes are sought, and from which a line is an overtone. With 2.5, harmonics of
# clipped signals and triangles are overtones, as measured by `python -m tests.golden --every 3`.
HIGHEST_MODE = 3.4
# Maximum length of a record, periods: a search in 18,000 of them takes 330 MB and 1.3 s, as measured.
LONGEST_SEARCH = 4096


def find_modes(samples: Samples, windows: Windows, known: F8 | float = 0.0) -> Modes:
    """Search for lines beside the main oscillation.

    The main oscillation is first removed as smooth curves through the windows' values. Then it is fitted together with
    each line by least squares, with slowly varying amplitude and phase, to block means over a twelfth of a period.
    A mode within a few reciprocals of the record's length of the main frequency is not searched for. It beats too
    slowly to be distinguished from a change of the amplitude.

    Samples far from the main oscillation are left out. ``known`` (n,) is the position of modes that an earlier search
    found, m: without it, the first swings of a mode that falls quickly would be left out too.
    """
    used = windows.used
    t = samples.track.t[used]
    if windows.t.size < LEAST_WINDOWS:
        return Modes(samples)
    turn = 2.0 * math.pi / windows.angular_frequency
    if float(t[-1] - t[0]) > LONGEST_SEARCH * turn:
        return Modes(samples)
    carrier = Carrier.through(windows, float(t[0]), float(t[-1]))
    residual = samples.track.y - carrier.position(samples.track.t)
    left, residual = (residual - known)[used], residual[used]
    spread = mad_sigma(left)
    if spread == 0.0:
        return Modes(samples, carrier=carrier)
    believed = np.abs(left) <= 8.0 * spread
    blocks = Blocks.of(t[believed], residual[believed], turn / 12.0, samples.track.rate_hz)
    band = _band(carrier, blocks)
    multiples = tuple(turns * carrier.angular_frequency / (2.0 * math.pi) for turns in HARMONICS)
    if not worth_a_look(blocks, band, multiples, CHANCE):
        return Modes(samples, carrier=carrier)
    return Modes(samples, _Search(carrier, blocks, band).run(), carrier)


def _band(carrier: Carrier, blocks: Blocks) -> SearchBand:
    main, bin_hz = carrier.angular_frequency / (2.0 * math.pi), 1.0 / blocks.seconds
    low = max((0.5 * carrier.rest_degree + 2.0) * bin_hz, 0.1 * main)
    return SearchBand(
        low, min(HIGHEST_MODE * main, 0.4 / blocks.step), ((main, (0.5 * carrier.degree + 2.0) * bin_hz),)
    )


class _Search:
    """The model of the blocks, which grows mode by mode."""

    def __init__(self, carrier: Carrier, blocks: Blocks, band: SearchBand) -> None:
        self.carrier, self.blocks, self.band = carrier, blocks, band
        self.t = blocks.t + blocks.origin
        self.main = carrier.wave(self.t)
        self.main_hz = carrier.angular_frequency / (2.0 * math.pi)
        # Data and columns over their standard uncertainty, an orthonormal basis of the columns, and the residual.
        self.data = blocks.y * blocks.weight
        self.columns = np.empty((self.t.size, 0))
        self.basis, self.left = self.columns, self.data
        self.add(_main_columns(carrier, self.t) * blocks.weight[:, None])
        self.found = list[Mode]()

    def run(self) -> tuple[Mode, ...]:
        """Return the modes, strongest first, then the harmonics, all fitted together."""
        self.harmonics()
        width = 2.0 / self.blocks.seconds
        self.hole(*((turns * self.main_hz, width) for turns in HARMONICS))
        for _ in range(ROUNDS):
            peak = strongest(self.blocks, self.left, self.basis, self.band)
            if peak is None or peak.false_alarm > CHANCE:
                break
            mode, columns = self.free(peak)
            if not self.band.inside(np.array([mode.frequency_hz]))[0]:
                break  # the fit drifted to a frequency that the model already contains
            self.add(columns)
            self.found.append(mode)
            self.hole((mode.frequency_hz, width))
        return tuple(sorted(self.together(), key=lambda mode: mode.turns > 0))

    def together(self) -> Iterator[Mode]:
        """Fit the coefficients of all modes together, because each was first fitted without the later ones."""
        ends = np.cumsum([0, *(mode.coefficients.size for mode in self.found)])
        values = np.linalg.lstsq(self.columns, self.data, rcond=None)[0]
        envelopes: C16 = values[values.size - 2 * ends[-1] :].view(np.complex128)
        for mode, start, end in zip(self.found, ends[:-1], ends[1:], strict=True):
            refitted = replace(mode, coefficients=envelopes[start:end])
            sizes = np.abs(refitted.envelope(self.t) * refitted.wave(self.t, self.main))
            yield replace(refitted, amplitude=float(np.sqrt(np.mean(sizes**2))))

    def hole(self, *holes: tuple[float, float]) -> None:
        self.band = replace(self.band, holes=(*self.band.holes, *holes))

    def add(self, columns: F8) -> None:
        """Add further columns (b, k) to the model."""
        self.columns = np.concatenate([self.columns, columns], axis=1)
        self.basis = np.concatenate([self.basis, np.linalg.qr(beyond(self.basis, columns))[0]], axis=1)
        self.left = self.data - self.basis @ (self.basis.T @ self.data)

    def columns_of(self, mode: Mode) -> F8:
        wave = mode.wave(self.t, self.main) * self.blocks.attenuation(mode.frequency_hz)
        return mode.columns(self.t, wave) * self.blocks.weight[:, None]

    def harmonics(self) -> None:
        """Test the multiples of the main frequency one after another, each beyond those found before it."""
        trials = [self.blank(turns, turns * self.main_hz) for turns in HARMONICS if self.sought(turns * self.main_hz)]
        taken, fallen = np.empty((self.t.size, 0)), 0.0
        least = evidence_for(CHANCE, len(HARMONICS))
        for trial in trials:
            both = np.concatenate([taken, self.columns_of(trial)], axis=1)
            _, _, fitted = self.fit(both)
            fall, left = float(fitted @ fitted), self.blocks.unweighted(self.left - fitted)
            density = spectral_density(self.blocks, left, trial.frequency_hz, self.band)
            if 0.5 * (fall - fallen) / self.blocks.samples > least * density:
                self.found.append(trial)
                taken, fallen = both, fall
        if taken.size:
            self.add(taken)

    def fit(self, columns: F8) -> tuple[F8, F8, F8]:
        """Return coefficients (k,) of further columns, their covariance for unit variance, and the fitted values.

        The fitted values are the contribution beyond the model; their squares are the reduction of the sum of squares.
        """
        own = beyond(self.basis, columns)
        q, r = np.linalg.qr(own)
        inverse = np.linalg.pinv(r)
        share = q.T @ self.left
        return np.asarray(inverse @ share), np.asarray(inverse @ inverse.T), np.asarray(q @ share)

    def sought(self, frequency_hz: float) -> bool:
        """Return whether the blocks can resolve a frequency and the model does not contain it already."""
        known = any(abs(frequency_hz - centre) < half for centre, half in self.band.holes)
        return 0.1 * self.main_hz < frequency_hz < 0.4 / self.blocks.step and not known

    def blank(self, turns: int, frequency_hz: float) -> Mode:
        """Return a mode that has yet to be fitted."""
        span = float(self.carrier.t[0]), float(self.carrier.t[-1])
        return Mode(turns, frequency_hz, span, np.zeros(1, np.complex128))

    def free(self, peak: Peak) -> tuple[Mode, F8]:
        """Refine a peak's frequency, decide whether it decays, and choose the degree of its envelope.

        Frequency and decay come from Gauss-Newton steps with columns w and :math:`\\tau w`. Here w falls with the decay
        so far, and :math:`\\tau` counts from the centre of its energy, so that the two are orthogonal. The ratio of the
        second column's complex coefficient to the first's is :math:`-\\Delta\\delta + 2\\pi i\\,\\Delta f`.
        """
        unit = peak.density * self.blocks.samples
        f, rate, u_rate = peak.frequency_hz, 0.0, math.inf
        tau = self.blocks.t - 0.5 * self.blocks.seconds
        longest = math.pi / self.blocks.seconds
        for _ in range(ROUNDS):
            angle, fall = 2.0 * math.pi * f * tau, np.exp(-rate * tau) * self.blocks.weight
            pair = np.stack([np.cos(angle), -np.sin(angle)]) * fall
            late = tau - float(np.average(tau, weights=fall**2))
            values, cofactors, _ = self.fit(np.concatenate([pair, pair * late]).T)
            z, slope = values.view(np.complex128).tolist()
            step = slope / z
            step *= longest / max(longest, abs(step))
            f, rate = f + step.imag / (2.0 * math.pi), rate - step.real
            u_rate = math.sqrt(max(cofactors[2, 2] * unit, 0.0)) / abs(z)
            if abs(step) < 2e-3 * longest:
                break
        # A varying mode has a wider spectrum, which must not overlap the variations of the main oscillation.
        room = int(2.0 * (abs(f - self.main_hz) * self.blocks.seconds - 1.0) - self.carrier.degree)
        degrees = np.arange(min(ENVELOPE, max(room, 0)) + 1)
        decay = rate if abs(rate) > SIGNIFICANT * u_rate else 0.0
        trial = replace(self.blank(0, f), decay=decay, coefficients=np.zeros(degrees.size, np.complex128))
        columns = self.columns_of(trial)
        # The first two, four, ... columns lower the sum of squares by the residual's components along their directions.
        q, _ = np.linalg.qr(beyond(self.basis, columns))
        falls = np.cumsum((q.T @ self.left) ** 2)[1::2]
        criterion = -falls / unit + 2.0 * (degrees + 1) * math.log(self.blocks.t.size)
        size = int(np.argmin(criterion)) + 1
        return replace(trial, coefficients=trial.coefficients[:size]), columns[:, : 2 * size]


def _main_columns(carrier: Carrier, t: F8) -> F8:
    """Return columns for rest position, cosine and sine of the main oscillation, each times Legendre polynomials."""
    x = np.clip(2.0 * (t - carrier.t[0]) / (carrier.t[-1] - carrier.t[0]) - 1.0, -1.0, 1.0)
    powers = np.polynomial.legendre.legvander(x, carrier.degree)
    phase = carrier.phase(t)
    return np.concatenate(
        [powers[:, : carrier.rest_degree + 1], powers * np.cos(phase)[:, None], powers * np.sin(phase)[:, None]], axis=1
    )
