"""Tiers: which form of each stage an accuracy tier runs, chosen once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pipeline.beside import Beside, set_apart
from pipeline.beside import Params as BesideParams
from pipeline.condition import Conditioned, condition
from pipeline.condition import Params as ConditionParams
from pipeline.cycles import Cycles, NoOscillation, find_cycles
from pipeline.cycles import Params as CyclesParams
from pipeline.damping import Damping, fit_damping
from pipeline.damping import Params as DampingParams
from pipeline.demodulate import Demodulated
from pipeline.demodulate import Params as DemodulateParams
from pipeline.phase import Params as PhaseParams
from pipeline.phase import PhaseFit, fit_phase
from pipeline.quick import Quick
from pipeline.quick_models import FAST_LAWS, fit_damping_quickly, fit_phase_quickly, fit_rest_quickly
from pipeline.quick_start import condition_quickly, find_cycles_quickly
from pipeline.rest import Rest, fit_rest
from pipeline.track import Track
from pipeline.waveform import Waveform, reconstruct

__all__ = ["Models", "Tier", "models_of", "tier_of"]


@dataclass(frozen=True, slots=True)
class Models:
    """What is made of the windows, each as the stage of that name.

    ``reconstruct`` is given the quick windows too, None where they could not be had.
    """

    fit_damping: Callable[[Demodulated, float, DampingParams], Damping]
    fit_phase: Callable[[Demodulated, Damping, PhaseParams], PhaseFit]
    fit_rest: Callable[[Demodulated], Rest]
    reconstruct: Callable[[Quick | None, Track, Demodulated, PhaseFit, Rest], Waveform]


@dataclass(frozen=True, slots=True)
class Tier:
    """The stages before the windows and beside them, the models, and whether the whole waveform is fitted last."""

    condition: Callable[[Track, ConditionParams], Conditioned]
    find_cycles: Callable[[Conditioned, CyclesParams], Cycles | NoOscillation]
    set_apart: Callable[[Conditioned, Cycles, Demodulated, BesideParams, DemodulateParams], tuple[Demodulated, Beside]]
    models: Models
    fits_waveform: bool = False


def tier_of(accuracy: str) -> Tier:
    """Return the stages of an accuracy tier."""
    return {"fast": FAST, "best": BEST}.get(accuracy, STANDARD)


def models_of(tier: Tier, quick: Quick | None) -> Models:
    """Return the tier's models; the full ones where a record was not fit for the quick windows."""
    return FULL if quick is None else tier.models


def _fit_damping(demodulated: Demodulated, t0: float, params: DampingParams) -> Damping:
    found = fit_damping_quickly(demodulated, t0, params) or fit_damping(demodulated, t0, params)
    if found.admissible or set(params.laws) != set(FAST_LAWS):
        return found
    # Few laws are tried for speed; where none of them holds, a wrong one would be stated.
    return fit_damping(demodulated, t0, replace(params, laws=DampingParams().laws))


def _fit_phase(demodulated: Demodulated, damping: Damping, params: PhaseParams) -> PhaseFit:
    return fit_phase_quickly(demodulated, damping) or fit_phase(demodulated, damping, params)


def _fit_rest(demodulated: Demodulated) -> Rest:
    return fit_rest_quickly(demodulated) or fit_rest(demodulated)


def _of_windows(quick: Quick | None, track: Track, _: Demodulated, phase: PhaseFit, rest: Rest) -> Waveform:
    assert quick is not None  # models_of sees to that
    return quick.waveform(track, phase.damping, phase, rest)


def _of_models(_: Quick | None, track: Track, demodulated: Demodulated, phase: PhaseFit, rest: Rest) -> Waveform:
    return reconstruct(track, demodulated, phase, rest)


def _leave(
    conditioned: Conditioned, _: Cycles, demodulated: Demodulated, __: BesideParams, ___: DemodulateParams
) -> tuple[Demodulated, Beside]:
    return demodulated, Beside.nothing(conditioned)


FULL = Models(fit_damping, fit_phase, fit_rest, _of_models)
QUICK = Models(_fit_damping, _fit_phase, _fit_rest, _of_windows)
FAST = Tier(condition_quickly, find_cycles_quickly, _leave, QUICK)
STANDARD = Tier(condition, find_cycles, set_apart, FULL)
BEST = Tier(condition, find_cycles, set_apart, FULL, fits_waveform=True)
