"""Sideways: modes beside the main oscillation, which make its amplitude and phase beat."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.numerics.estimate import Estimate
from pipeline.numerics.robust import mad_sigma
from pipeline.numerics.spectrum import Band, Blocks, Peak, false_alarm, spectral_density, strongest, worth_a_look
from pipeline.oscillation.carrier import Carrier
from pipeline.oscillation.condition import Conditioned
from pipeline.oscillation.demodulate import Demodulated
from pipeline.oscillation.modes import Mode, Sideways
from pipeline.track import F8, UNUSABLE

__all__ = ["Params", "find_sideways", "without"]

# Turns of (sideways mode, main oscillation) at which a range measured along a slant shows a product of both.
PRODUCTS = ((2, 0), (1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (1, -2), (3, 0))
HARMONICS = ((0, 2), (0, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """Options of :func:`find_sideways`.

    Parameters
    ----------
    false_alarm : float
        Probability that a record without any shows a mode or a harmonic, half for either.
    most : int
        Modes sought, harmonics and products not counted.
    envelope : int
        Highest degree of the polynomial that a mode's amplitude and phase may follow.
    least_windows : int
        Fewer windows show no mode apart from the main oscillation.
    most_periods : int
        Longer records are not searched: the model of the blocks would outgrow the memory.
    """

    false_alarm: float = 0.01
    most: int = 4
    envelope: int = 4
    least_windows: int = 6
    most_periods: int = 4096


def find_sideways(conditioned: Conditioned, demodulated: Demodulated, params: Params | None = None) -> Sideways:
    """Look for lines beside the main oscillation.

    Parameters
    ----------
    conditioned : Conditioned
    demodulated : Demodulated
        Its windows give the main oscillation, whatever law that follows, its flags the samples.
    params : Params, optional

    Returns
    -------
    Sideways

    Notes
    -----
    The main oscillation is taken out as smooth curves through the windows' values, then, together with each line, by
    least squares with slowly varying amplitude and phase, on block means of a twelfth of a period.
    A mode nearer to the main frequency than a few reciprocals of the record's length beats too slowly to be told
    from a change of the amplitude and is not sought.
    """
    params = params or Params()
    used = (demodulated.flags & UNUSABLE) == 0
    t = conditioned.track.t[used]
    if demodulated.t.size < params.least_windows:
        return Sideways((), None)
    turn = 2.0 * math.pi / demodulated.angular_frequency
    if float(t[-1] - t[0]) > params.most_periods * turn:
        return Sideways((), None)
    carrier = Carrier.through(demodulated, float(t[0]), float(t[-1]))
    residual = conditioned.track.y[used] - carrier.position(t)
    spread = mad_sigma(residual)
    if spread == 0.0:
        return Sideways((), carrier)
    believed = np.abs(residual) <= 8.0 * spread
    blocks = Blocks.of(t[believed], residual[believed], turn / 12.0, conditioned.track.rate_hz)
    band = _band(carrier, blocks)
    multiples = tuple(turns[1] * carrier.angular_frequency / (2.0 * math.pi) for turns in HARMONICS)
    if not worth_a_look(blocks, band, multiples, 0.5 * params.false_alarm):
        return Sideways((), carrier)
    return Sideways(_Search(carrier, blocks, band, params).run(), carrier)


def without(conditioned: Conditioned, sideways: Sideways) -> Conditioned:
    """Return the record with the modes taken out of its distances; flags and times stay."""
    track = conditioned.track
    return replace(conditioned, track=replace(track, y=track.y - sideways.position(track.t)))


def _band(carrier: Carrier, blocks: Blocks) -> Band:
    main, bin_hz = carrier.angular_frequency / (2.0 * math.pi), 1.0 / blocks.seconds
    low = max((0.5 * carrier.rest_degree + 2.0) * bin_hz, 0.1 * main)
    return Band(low, min(3.4 * main, 0.4 / blocks.step), ((main, (0.5 * carrier.degree + 2.0) * bin_hz),))


class _Search:
    """The model of the blocks as it grows, mode by mode."""

    def __init__(self, carrier: Carrier, blocks: Blocks, band: Band, params: Params) -> None:
        self.carrier, self.blocks, self.params = carrier, blocks, params
        self.band = band
        self.t = blocks.t + blocks.origin
        self.main = _main_columns(carrier, self.t) * blocks.weight[:, None]
        self.columns = self.main
        self.settle()

    def settle(self) -> None:
        """Fit what the model holds now."""
        self.basis = np.linalg.qr(self.columns)[0]
        target = self.blocks.y * self.blocks.weight
        left = target - self.basis @ (self.basis.T @ target)
        self.residual = self.blocks.unweighted(left)

    def run(self) -> tuple[Mode, ...]:
        """Return modes, the strongest first, with their products, then harmonics; all fitted together."""
        harmonics = list(self.locked(HARMONICS, None))
        main, width = self.carrier.angular_frequency / (2.0 * math.pi), 2.0 / self.blocks.seconds
        self.hole(*((turns[1] * main, width) for turns in HARMONICS))
        own, products = list[Mode](), list[Mode]()
        for _ in range(self.params.most):
            peak = strongest(self.blocks, self.residual, self.basis, self.band)
            if peak is None or peak.false_alarm > 0.5 * self.params.false_alarm:
                break
            mode = self.free(peak)
            if not self.band.inside(np.array([mode.frequency.value]))[0]:
                break  # it ran away into what the model holds already
            self.add(mode)
            self.hole((mode.frequency.value, width))
            own.append(mode)
            if len(own) == 1:
                products.extend(self.locked(PRODUCTS, mode))
        return self.together((*own, *products, *harmonics))

    def together(self, modes: tuple[Mode, ...]) -> tuple[Mode, ...]:
        """Fit the coefficients of all modes at once: each was found before the later ones were known."""
        if not modes:
            return modes
        columns = np.concatenate([self.main, *(self.weighted(mode) for mode in modes)], axis=1)
        values = np.linalg.lstsq(columns, self.blocks.y * self.blocks.weight, rcond=None)[0][self.main.shape[1] :]
        ends = np.cumsum([mode.coefficients.size for mode in modes])
        return tuple(
            self.sized(replace(mode, coefficients=part))
            for mode, part in zip(modes, np.split(values, ends[:-1]), strict=True)
        )

    def sized(self, mode: Mode) -> Mode:
        """Return the mode with the amplitude that its coefficients give."""
        half = mode.degree + 1
        quadrature = np.concatenate([mode.coefficients[half:], -mode.coefficients[:half]])
        columns = mode.columns(self.t)
        size = math.sqrt(float(np.mean((columns @ mode.coefficients) ** 2 + (columns @ quadrature) ** 2)))
        return replace(mode, amplitude=replace(mode.amplitude, value=size))

    def hole(self, *holes: tuple[float, float]) -> None:
        self.band = replace(self.band, holes=(*self.band.holes, *holes))

    def add(self, mode: Mode) -> None:
        self.columns = np.concatenate([self.columns, self.weighted(mode)], axis=1)
        self.settle()

    def weighted(self, mode: Mode) -> F8:
        fade = self.blocks.attenuation(mode.frequency.value)
        return mode.columns(self.t) * (fade * self.blocks.weight[:, None])

    def fitted(self, columns: F8) -> tuple[F8, F8, float]:
        """Coefficients of columns beyond the model, their cofactors, and half the fall of chi-square."""
        beyond = columns - self.basis @ (self.basis.T @ columns)
        q, r = np.linalg.qr(beyond)
        inverse = np.linalg.pinv(r)
        share = q.T @ (self.residual * self.blocks.weight)
        return inverse @ share, inverse @ inverse.T, 0.5 * float(share @ share)

    def locked(self, orders: tuple[tuple[int, int], ...], base: Mode | None) -> Iterator[Mode]:
        """Test what turns with the main oscillation and a mode together: no frequency is free."""
        main = self.carrier.angular_frequency / (2.0 * math.pi)
        nothing = Estimate(0.0, 0.0, "1/s")
        for turns in orders:
            f = turns[1] * main + (turns[0] * base.frequency.value if base else 0.0)
            if not 0.1 * main < abs(f) < 0.4 / self.blocks.step or any(
                abs(abs(f) - centre) < half for centre, half in self.band.holes
            ):
                continue
            trial = Mode(
                "harmonic" if base is None else "product",
                turns,
                Estimate(abs(f), base.frequency.u * abs(turns[0]) if base else 0.0, "Hz"),
                Estimate(0.0, 0.0, "m"),
                nothing,
                1.0,
                self.carrier,
                base,
                0,
                np.zeros(2),
            )
            columns = self.weighted(trial)
            values, cofactors, gain = self.fitted(columns)
            left = self.residual - self.blocks.unweighted(columns @ values)
            unit = spectral_density(self.blocks, left, abs(f), self.band) * self.blocks.samples
            chance = false_alarm(gain / unit, len(orders))
            if chance > 0.5 * self.params.false_alarm:
                continue
            shape = math.sqrt(float(np.mean(trial.columns(self.t)[:, 0] ** 2 + trial.columns(self.t)[:, 1] ** 2)))
            u = math.sqrt(max(float(np.mean(np.diag(cofactors))) * unit, 0.0)) * shape
            amplitude = Estimate(float(np.hypot(*values)) * shape, u, "m")
            mode = replace(trial, amplitude=amplitude, false_alarm=chance, coefficients=values)
            self.add(mode)
            yield mode

    def free(self, peak: Peak) -> Mode:
        """Refine a peak's frequency, see whether it decays, and choose how far its envelope varies besides."""
        unit = peak.density * self.blocks.samples
        f, rate, u_rate = peak.frequency_hz, 0.0, math.inf
        middle = 0.5 * self.blocks.seconds
        tau = self.blocks.t - middle
        for _ in range(4):
            angle = 2.0 * math.pi * f * tau
            pair = np.stack([np.cos(angle), np.sin(angle)], axis=1) * self.blocks.weight[:, None]
            values, cofactors, _ = self.fitted(np.concatenate([pair, pair * tau[:, None]], axis=1))
            z, slope = complex(values[0], -values[1]), complex(values[2], -values[3])
            ratio = slope / z
            rate, u_rate = -ratio.real, math.sqrt(max(cofactors[2, 2] * unit, 0.0)) / abs(z)
            step = float(np.clip(ratio.imag / (2.0 * math.pi), -0.5 / self.blocks.seconds, 0.5 / self.blocks.seconds))
            f += step
            if abs(step) < 1e-3 / self.blocks.seconds:
                break
        trial = Mode(
            "mode",
            (1, 0),
            Estimate(f, u_rate / (2.0 * math.pi), "Hz"),
            Estimate(0.0, 0.0, "m"),
            Estimate(rate if abs(rate) > 3.0 * u_rate else 0.0, u_rate, "1/s"),
            peak.false_alarm,
            self.carrier,
            None,
            0,
            np.zeros(2),
        )
        best: tuple[float, Mode] | None = None
        # A mode that varies reaches further; it must not reach what the main oscillation may vary by.
        main = self.carrier.angular_frequency / (2.0 * math.pi)
        room = int(2.0 * (abs(f - main) * self.blocks.seconds - 1.0) - self.carrier.degree)
        for degree in range(min(self.params.envelope, max(room, 0)) + 1):
            trial = replace(trial, degree=degree)
            values, cofactors, gain = self.fitted(self.weighted(trial))
            criterion = -2.0 * gain / unit + 2.0 * (degree + 1) * math.log(self.blocks.t.size)
            if best is None or criterion < best[0]:
                u = math.sqrt(max(cofactors[0, 0] * unit, 0.0))
                best = (criterion, self.sized(replace(trial, coefficients=values, amplitude=Estimate(0.0, u, "m"))))
        assert best is not None
        return best[1]


def _main_columns(carrier: Carrier, t: F8) -> F8:
    """Rest position, cosine and sine of the main oscillation, each times powers of time."""
    x = np.clip(2.0 * (t - carrier.t[0]) / (carrier.t[-1] - carrier.t[0]) - 1.0, -1.0, 1.0)
    powers = np.polynomial.legendre.legvander(x, carrier.degree)
    phase = carrier.phase(t)
    return np.concatenate(
        [powers[:, : carrier.rest_degree + 1], powers * np.cos(phase)[:, None], powers * np.sin(phase)[:, None]], axis=1
    )
