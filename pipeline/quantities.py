"""The estimates, the inputs of their uncertainty budgets, and the effects: their labels, symbols and units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.units import Unit

# What a value may come from: the times and the distances (or other values) of the record, the scene, one frequency, its
# change with the amplitude, and a law of damping.
MODEL_PARTS = ("times", "distances", "scene", "frequency", "small_swings", "damping")


@dataclass(frozen=True, slots=True)
class Quantity:
    """An estimate."""

    name: str  # name in JSON, tables of numbers and Python
    label: str  # name in words
    # symbol, page_symbol, tex_symbol: symbol in ASCII, in Unicode (with an index after a space), and in TeX without the
    # ``$``.
    symbol: str
    page_symbol: str
    tex_symbol: str
    unit: str | Unit  # SI unit; a Unit if it depends on what was recorded
    parts: tuple[str, ...]  # parts of the model from which the value comes, of :data:`MODEL_PARTS`
    in_table: bool = True  # whether Table 1 shows the estimate
    by_law: bool = False  # whether Table 1 names the damping law of the estimate, because its value depends on the law

    def unit_in(self, record_unit: str) -> str:
        """Return the unit of the estimate in a run recorded in ``record_unit``.

        >>> QUANTITIES["beta"].unit_in("m"), QUANTITIES["beta"].unit_in("V"), QUANTITIES["period"].unit_in("V")
        ('1/(m s)', '1/(V s)', 's')
        """
        return self.unit.of(record_unit) if isinstance(self.unit, Unit) else self.unit


@dataclass(frozen=True, slots=True)
class Input:
    """An input of an uncertainty budget."""

    label: str  # name in words
    symbol: str = ""  # symbol in ASCII; "" for a group of parameters, or for a possible error without a symbol
    unit: str | Unit = ""  # as :attr:`Quantity.unit`; "" for a ratio or a group


_OF_TIMES, _OF_SIZES = ("times",), ("distances",)
_OF_PHASE, _OF_SMALL = ("times", "frequency"), ("times", "small_swings")
_OF_MOTION = ("distances", *_OF_PHASE)
_OF_RATE, _OF_DRAG = ("times", "damping"), ("distances", "times", "damping")
_OF_FLOW = (*_OF_MOTION, "scene")

_QUANTITIES = (
    Quantity("period", "period", "T", "T", "T", "s", _OF_PHASE),
    Quantity("period_small_swings", "period of very small swings", "T_s", "T s", r"T_\mathrm{s}", "s", _OF_SMALL),
    Quantity("first_mode_period", "period of the first mode", "T_1", "T 1", "T_1", "s", _OF_TIMES),
    Quantity("second_mode_period", "period of the second mode", "T_2", "T 2", "T_2", "s", _OF_TIMES),
    Quantity("first_mode_amplitude", "amplitude of the first mode", "A_1", "A 1", "A_1", Unit(1), _OF_SIZES),
    Quantity("second_mode_amplitude", "amplitude of the second mode", "A_2", "A 2", "A_2", Unit(1), _OF_SIZES),
    Quantity("frequency", "frequency", "f", "f", "f", "Hz", _OF_PHASE),
    Quantity("angular_frequency", "angular frequency", "omega", "ω", r"\omega", "rad/s", _OF_PHASE),
    Quantity("spring_constant", "spring constant", "k", "k", "k", "N/m", (*_OF_PHASE, "scene")),
    Quantity("gravity", "acceleration of gravity", "g", "g", "g", "m/s^2", (*_OF_SMALL, "scene")),
    Quantity("amplitude", "amplitude at the start", "A0", "A₀", "A_0", Unit(1), _OF_SIZES),
    Quantity("displacement_amplitude", "amplitude of the displacement", "x0", "x₀", "x_0", "m", _OF_MOTION),
    Quantity("angle_amplitude", "amplitude of the angle", "theta0", "θ₀", r"\theta_0", "rad", _OF_MOTION),
    Quantity("phase", "phase at the start", "phi0", "φ₀", r"\varphi_0", "rad", _OF_PHASE, in_table=False),
    Quantity("offset", "rest position", "y0", "y₀", "y_0", Unit(1), _OF_SIZES),
    Quantity("noise", "noise of one sample", "sigma", "σ", r"\sigma", Unit(1), _OF_SIZES),
    Quantity("damping_rate", "damping rate at the start", "lambda", "λ", r"\lambda", "1/s", _OF_RATE, by_law=True),
    Quantity("relaxation_rate", "relaxation rate", "r", "r", "r", "1/s", _OF_TIMES),
    Quantity("relaxation_rate_slow", "slow relaxation rate", "r_1", "r 1", "r_1", "1/s", _OF_TIMES),
    Quantity("relaxation_rate_fast", "fast relaxation rate", "r_2", "r 2", "r_2", "1/s", _OF_TIMES),
    Quantity("quality_factor", "quality factor", "Q", "Q", "Q", "", ("frequency", "damping"), by_law=True),
    # The velocity of the motion; it is in rad/s if an angle or its rate was recorded.
    Quantity("velocity_rms", "velocity, root mean square", "v_rms", "v rms", r"v_\mathrm{rms}", "m/s", _OF_MOTION),
    Quantity("reynolds_number", "Reynolds number", "Re", "Re", r"\mathit{Re}", "", _OF_FLOW),
    Quantity("reynolds_number_start", "Reynolds number at the start", "Re_0", "Re 0", r"\mathit{Re}_0", "", _OF_FLOW),
    Quantity(
        "keulegan_carpenter_number", "Keulegan-Carpenter number", "KC", "KC", r"\mathit{KC}", "", ("distances", "scene")
    ),
    Quantity(
        "drag_coefficient", "quadratic drag coefficient", "C_d", "C d", r"C_\mathrm{d}", "", (*_OF_FLOW, "damping")
    ),
    Quantity("gamma", "linear damping", "gamma", "γ", r"\gamma", "1/s", _OF_RATE, by_law=True),
    Quantity("beta", "quadratic damping", "beta", "β", r"\beta", Unit(-1, -1), _OF_DRAG, by_law=True),
    Quantity("mu", "dry friction", "mu", "μ", r"\mu", Unit(1, -1), _OF_DRAG, by_law=True),
    Quantity("c", "drag by a power of the amplitude", "c", "c", "c", Unit(1, -1, less="n"), _OF_DRAG, by_law=True),
    Quantity("n", "that power", "n", "n", "n", "", ("damping",), by_law=True),
)
QUANTITIES: Mapping[str, Quantity] = {quantity.name: quantity for quantity in _QUANTITIES}
"""All estimates by name, in the order of Table 1."""

INPUTS: Mapping[str, Input] = {
    # Inputs estimated from the recording.
    "angular_frequency": Input("scatter of the phases", "omega", "rad/s"),
    "small_swings": Input("scatter of the phases, and choice of the law of the frequency", "omega_s", "rad/s"),
    "mean_frequency": Input("mean frequency, instead of that of very small swings or at the start"),
    "phase": Input("scatter of the phases", "phi0", "rad"),
    "rest_position": Input("scatter of the rest position", "y0", Unit(1)),
    "noise": Input("scatter of the samples", "sigma", Unit(1)),
    "damping_law": Input("scatter of the amplitudes"),
    "fitted_motion": Input("scatter of the samples about the motion"),
    "local_decay": Input("scatter of the first amplitudes, which no law describes"),
    "choice_of_law": Input("choice among admissible laws"),
    # Inputs from the scene, or properties of the instrument.
    "clock_rate": Input("rate of the clock", "r"),
    "bob_mass": Input("mass of the bob", "m", "kg"),
    "spring_mass": Input("mass of the spring", "m_s", "kg"),
    "unstated_spring_mass": Input("mass of the spring, which was not stated", "m_s", "kg"),
    "pendulum_length": Input("length of the pendulum", "l", "m"),
    "disc_diameter": Input("diameter of the disc", "D", "m"),
    "air_temperature": Input("air temperature", "t", "degC"),
    "air_pressure": Input("air pressure", "p", "Pa"),
    "relative_humidity": Input("relative humidity", "h"),
    "density_formula": Input("formula of the air's density"),
    "viscosity_formula": Input("formula of the air's viscosity"),
    "speed_of_sound_formula": Input("formula of the speed of sound"),
    "recorded_speed_of_sound": Input("speed of sound of the record"),
    "calibrated_scale": Input("calibration of the scale"),
    "sensor_zero": Input("calibration of the zero", "z", Unit(1)),
    "sensor_mean_samples": Input("running mean of the sensor"),
    "sensor_lag": Input("lag of the sensor", "tau", "s"),
    # Contradictions between the recording and its model.
    "lost_rows": Input("samples that are missing between others"),
    "crest": Input("crests of a swing whose stiffness changes with the amplitude"),
    "model_misfit": Input("what differs from a sinusoid in every period"),
    "rounding": Input("rounding to steps larger than the noise"),
    "held_samples": Input("distances held by the sensor"),
    "sensor_smoothing": Input("smoothing by the sensor"),
    "random_excitation": Input("amplitude that wanders at random"),
    "implausible_motion": Input("motion that no bob on a spring makes"),
    "implausible_distance": Input("distances that no sensor measures"),
}
"""All inputs of :mod:`pipeline.results.derive` by name."""


EFFECTS: Mapping[str, str] = {
    "spring_mass": "mass of the spring",
    "added_mass": "air that the disc carries along",
    "disc_drag": "drag of the disc",
    "damping": "damping",
    "viscous_drag": "viscous drag",
    "quadratic_drag": "quadratic drag",
    "friction": "dry friction",
    "amplitude_dependent_frequency": "frequency that depends on the amplitude",
    "rest_drift": "drift of the rest position",
    "sideways_mode": "sideways mode",
    "harmonics": "harmonics",
    "buoyancy": "buoyancy",
    "speed_of_sound": "speed of sound",
    "temperature": "air temperature",
    "clock_rate": "rate of the clock",
}
