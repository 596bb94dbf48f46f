"""The fitted motion: amplitude, phase and rest position against time, from windows or from the equation of motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.damping.laws import units_of
from pipeline.damping.select import Damping
from pipeline.motion.equation_fit import EquationFit
from pipeline.motion.phase import BACKBONE, PhaseFit, fit_phase
from pipeline.motion.waveform import Rest, Waveform, fit_rest, reconstruct
from pipeline.motion.waveform_fit import FullFit, fit_record
from pipeline.samples.condition import Conditioned
from pipeline.windows.demodulate import Demodulated
from pipeline.windows.disturbances import Disturbances


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """An oscillation in the form that the stages after the fit use.

    Parameters
    ----------
    demodulated : Demodulated
        The windows with the final flags.
    disturbances : Disturbances
        The disturbances that were subtracted from the record before the fit.
    damping, phase, rest, waveform
        Results for the record without these disturbances.
    full : FullFit or None
        The fit of the whole waveform, if one was made.
    """

    demodulated: Demodulated
    disturbances: Disturbances
    damping: Damping
    phase: PhaseFit
    rest: Rest
    waveform: Waveform
    full: FullFit | None

    def in_unit(self, unit: str) -> Fitted:
        """Return this fit with the unit ``unit`` in place of m, for a record whose values are in another unit.

        The stages do not know the unit of the values and label them with m.
        """
        if unit == "m":
            return self
        fits = {
            name: replace(fit, joint=replace(fit.joint, units=units_of(fit.law, unit)))
            for name, fit in self.damping.fits.items()
        }
        damping, backbone = replace(self.damping, fits=fits), self.phase.backbone
        bent = None if backbone is None else replace(backbone, unit=BACKBONE.of(unit))
        return replace(
            self,
            damping=damping,
            phase=replace(self.phase, damping=damping, backbone=bent),
            rest=replace(self.rest, mean=replace(self.rest.mean, unit=unit)),
        )


def fit_by_windows(demodulated: Demodulated, disturbances: Disturbances, damping: Damping) -> Fitted:
    """Return a weakly damped oscillation from the amplitudes, phases and rest positions of its windows.

    Parameters
    ----------
    demodulated, disturbances, damping
        Outputs of the stages with these names.
    """
    phase, rest = fit_phase(demodulated, damping), fit_rest(demodulated)
    waveform = reconstruct(disturbances.conditioned.track, demodulated, phase, rest)
    return Fitted(demodulated, disturbances, damping, phase, rest, waveform, None)


def fit_waveform(fitted: Fitted, conditioned: Conditioned) -> Fitted:
    """Return the oscillation from a fit of the whole waveform that starts from the windows' result.

    Parameters
    ----------
    fitted : Fitted
        The fit by windows.
    conditioned : Conditioned
        The samples including all disturbances.
    """
    disturbances = fitted.disturbances
    # With the disturbances' columns in the model, the samples without disturbances give the same fit as the original
    # samples, because the columns span the subtracted motion.
    full = fit_record(
        disturbances.conditioned,
        fitted.demodulated,
        fitted.damping,
        fitted.phase,
        fitted.rest,
        fitted.waveform,
        extra=disturbances.columns(conditioned.track.t),
    )
    demodulated = replace(fitted.demodulated, flags=full.flags)
    return Fitted(demodulated, disturbances, full.damping, full.phase, full.rest, full.waveform, full)


def fit_by_equation(solved: EquationFit, conditioned: Conditioned, demodulated: Demodulated) -> Fitted:
    """Return a strongly damped oscillation from one solution of the equation of motion.

    Parameters
    ----------
    solved : EquationFit
        The solution for the whole record, from which no disturbances were subtracted.
    conditioned, demodulated
        Outputs of the stages with these names.
    """
    demodulated = solved.windows(demodulated)
    phase, rest = solved.phase(demodulated), solved.rest(demodulated)
    return Fitted(demodulated, Disturbances.nothing(conditioned), solved.damping, phase, rest, solved.waveform, None)
