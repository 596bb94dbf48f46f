"""The terms of springmass, each with one meaning, for the glossary page and the end of a report."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["TERMS", "Term"]


@dataclass(frozen=True, slots=True)
class Term:
    """A term and its meaning in springmass.

    Parameters
    ----------
    name : str
        Singular, in lower case apart from proper names.
    meaning : str
        One or two sentences of plain text.
    symbol : str or None
        The symbol in tables and figures; None if the term has none.
    of_program : bool
        Whether the term is about files and programs rather than results. A report omits such terms.
    """

    name: str
    meaning: str
    symbol: str | None = None
    of_program: bool = False


TERMS: tuple[Term, ...] = (
    Term("accuracy", "One of three sets of options for the analysis: fast, standard or best."),
    Term("added mass", "Air that moves with the bob and the disc and adds to the mass that swings."),
    Term("admissible law", "A damping law that may be the true one: neither rejected nor unlikely."),
    Term(
        "amplitude", "The largest distance of the bob from its rest position during one period; A₀ at the start.", "A"
    ),
    Term("angular frequency", "2π times the frequency.", "ω"),
    Term("bench", "The apparatus: support, spring, bob, disc and sensor."),
    Term("bias", "The mean error of a method over many runs. More runs do not reduce it."),
    Term("BIC", "Bayesian information criterion: it ranks laws by their fit and by their number of parameters."),
    Term("bob", "The body that hangs on the spring."),
    Term(
        "channel", "One column of a recording that can be analysed, such as a distance or a velocity.", of_program=True
    ),
    Term(
        "chi-square",
        "The sum of (residual divided by its standard deviation)²; a good fit has about 1 for each residual.",
        "χ²",
    ),
    Term("clipping", "Distances that are cut off at a level because the sensor cannot see further."),
    Term("course", "Many runs that are analysed together and give one table.", of_program=True),
    Term("coverage", "How often an interval contains the true value: 95 % for a good 95 % interval."),
    Term(
        "coverage factor",
        "How many standard uncertainties an expanded uncertainty has, usually 2. "
        "Metrology writes k too, which is not the spring constant.",
        "k",
    ),
    Term("crest", "The part of an oscillation near a turning point, where the distance is largest or smallest."),
    Term("damping rate", "How fast the amplitude A falls, divided by the amplitude: -(dA/dt)/A.", "λ"),
    Term("demodulation", "Fitting a sinusoid to each window, which gives its amplitude and phase."),
    Term("drag coefficient", "The drag of the disc divided by its area and by the dynamic pressure of the air.", "C_d"),
    Term("drop-out", "A reading without a distance, for example because no echo came back."),
    Term(
        "dry friction",
        "Friction of constant size, dA/dt = -μ; the amplitude falls in a straight line and the bob stops.",
        "μ",
    ),
    Term("expanded uncertainty", "The standard uncertainty times a coverage factor, usually 2 for about 95 %.", "U"),
    Term("false echo", "A distance to something other than the bob."),
    Term("false-alarm probability", "How often a test reports something although there is only noise."),
    Term("finding", "Anything reported about a run. Its severity is error, warning or note (info in JSON)."),
    Term("flag", "A mark on a sample that states what is unusual about it, such as a false echo."),
    Term("frequency", "Periods per second.", "f"),
    Term("gap", "A stretch of time without samples."),
    Term("Keulegan-Carpenter number", "2π times the amplitude divided by the diameter of the disc.", "KC"),
    Term(
        "law",
        "The equation of damping. It states how the amplitude falls; "
        "with dry friction, linear and quadratic drag together dA/dt = -(μ + γA + βA²).",
    ),
    Term(
        "linear drag",
        "Drag proportional to the velocity v, dA/dt = -γA; the amplitude falls exponentially. "
        "For the force -bv on the mass m that swings, b = 2mγ.",
        "γ",
    ),
    Term(
        "mass that swings",
        "The mass that sets the period: everything on the spring, a third of the spring and a little more, "
        "and the added mass; k = mω².",
        "m",
    ),
    Term(
        "NeXus", "A convention for the names in HDF5 files, which hold large tables of measurements.", of_program=True
    ),
    Term("noise", "Random scatter of single distances, given as one standard deviation.", "σ"),
    Term("nominal", "Stated by a maker or a program, but not measured."),
    Term("period", "The duration of one oscillation.", "T"),
    Term("phase", "The position within a period, as an angle.", "φ"),
    Term("phase plot", "Velocity against position: without damping an ellipse, with damping a spiral inwards."),
    Term(
        "quadratic drag",
        "Drag proportional to the square of the velocity v, dA/dt = -βA²; typical of a disc in air. "
        "For a force of size cv², c = 3πmβ/(4ω).",
        "β",
    ),
    Term("quality factor", "ω₀/2λ: the larger it is, the more slowly the oscillation decays.", "Q"),
    Term("quantum", "The smallest step between two distances in a file or of a sensor."),
    Term("recording", "A file that somebody recorded, with springmass or with another program."),
    Term("reduced chi-square", "Mean squared residual divided by that expected from the noise; 1 is good.", "χ²/ν"),
    Term(
        "rejected law",
        "A damping law that the recording contradicts: its chi-square is larger than in 999 of 1000 runs of that law, "
        "or a coefficient is negative by more than two standard uncertainties.",
    ),
    Term("residual", "A sample minus the fitted value at its time."),
    Term("rest position", "The distance at which the bob hangs still.", "y₀"),
    Term("Reynolds number", "Inertia of the air compared with its viscosity: ρ v D/η, with the rms velocity v.", "Re"),
    Term("rms", "Root mean square: the root of the mean of the squares, as in v_rms, the rms velocity."),
    Term("run", "One measurement, as it is analysed."),
    Term(
        "run file",
        "The file NAME.h5 with everything about a recorded run; it is never changed afterwards.",
        of_program=True,
    ),
    Term("sample", "One reading with its time."),
    Term("scatter", "Random differences between values that should be equal."),
    Term("scene", "What is known of the bench: masses, disc, air and sensor."),
    Term("second mode", "A second oscillation of the bob, for example sideways like a pendulum."),
    Term(
        "serial port",
        "The connection of a sensor, usually by USB: COM3 on Windows, /dev/ttyUSB0 on Linux.",
        of_program=True,
    ),
    Term("sha256", "A checksum of 64 digits; files with the same checksum have the same contents."),
    Term("siunitx", "A package of LaTeX that typesets numbers with units.", of_program=True),
    Term("spectrum", "How much of each frequency a recording contains; an oscillation is a peak."),
    Term("spring constant", "The force of the spring divided by its extension.", "k"),
    Term(
        "standard uncertainty",
        "The standard deviation of the values that the quantity may reasonably have; "
        "value ± u contains the true value in about 68 % of cases.",
        "u",
    ),
    Term("TOML", "A text format for settings, with lines such as mass_kg = 0.2176.", of_program=True),
    Term("track", "In Python, the times and distances of a run before the analysis.", of_program=True),
    Term("trap", "Something in a file that is easily misread; springmass formats FILE lists it.", of_program=True),
    Term("type A uncertainty", "The part that comes from scatter. It shrinks with a longer recording."),
    Term("type B uncertainty", "Everything else, such as the balance, the clock and the speed of sound."),
    Term(
        "unlikely law",
        "A damping law that is not rejected, but describes the run worse for its number of coefficients: "
        "its BIC is more than 6 above the lowest, or it adds to the selected law a term that changes nothing.",
    ),
    Term("variance", "The square of the standard uncertainty; the variances of independent causes add up."),
    Term(
        "virtual environment",
        "A folder with Python packages for one project, here .venv; venv makes it.",
        of_program=True,
    ),
    Term("window", "The samples of one period or a few that give one amplitude and one phase."),
    Term("wire log", "The file NAME.wire with every byte of the sensor, written during a recording.", of_program=True),
)
"""All terms, in alphabetical order."""
