"""The registry of quantities: one row each, from which plots, files, command line and documents are fed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from chuteflow.amounts import bare, is_like, positive_amount, read_si
from chuteflow.checks import number
from chuteflow.errors import InputError


@dataclass(frozen=True)
class Quantity:
    """A quantity of a flow.

    ``name`` is the attribute of :class:`chuteflow.Flow` (or of its profile); ``symbol`` and ``latex`` its
    notation; ``dimension`` the exponents of grain density, grain diameter and acceleration g cos(theta) in
    its scale; ``unit`` the SI unit; ``equation`` where the paper defines it.
    """

    name: str
    symbol: str
    latex: str
    dimension: tuple[float, float, float]
    unit: str
    equation: str
    description: str

    @property
    def unit_without_scales(self) -> str:
        """Its unit where it is over its scale: "1", but for what has none."""
        return "1" if any(self.dimension) else self.unit


#: Fields over height, attributes of a profile.
FIELDS: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity("height", "z", "z", (0, 1, 0), "m", "section 3.1", "height above the base"),
        Quantity("volume_fraction", "nu", r"\nu", (0, 0, 0), "1", "(2.7)", "volume fraction of grains"),
        Quantity("granular_temperature", "T", "T", (0, 1, 1), "m^2/s^2", "section 2.1", "granular temperature"),
        Quantity("velocity", "u", "u", (0, 0.5, 0.5), "m/s", "(3.10)", "velocity down the slope"),
        Quantity("heat_flux", "q", "q", (1, 1.5, 1.5), "W/m^2", "(3.6)", "flux of fluctuation energy upwards"),
        Quantity(
            "conductive_heat_flux",
            "q_T",
            "q_T",
            (1, 1.5, 1.5),
            "W/m^2",
            "(3.6)",
            "part of the heat flux along the temperature gradient",
        ),
        Quantity(
            "density_heat_flux",
            "q_nu",
            r"q_\nu",
            (1, 1.5, 1.5),
            "W/m^2",
            "(3.6)",
            "part of the heat flux along the density gradient",
        ),
        Quantity("normal_stress", "P_zz", "P_{zz}", (1, 1, 1), "Pa", "(3.4)", "normal stress"),
        Quantity("shear_stress", "P_xz", "P_{xz}", (1, 1, 1), "Pa", "(3.5)", "shear stress"),
        Quantity("shear_rate", "du/dz", r"\mathrm{d}u/\mathrm{d}z", (0, -0.5, 0.5), "1/s", "(3.10)", "shear rate"),
        Quantity(
            "production",
            "-P_xz du/dz",
            r"-P_{xz}\,\mathrm{d}u/\mathrm{d}z",
            (1, 0.5, 1.5),
            "W/m^3",
            "(3.3)",
            "fluctuation energy produced by shear work",
        ),
        Quantity(
            "dissipation",
            "gamma",
            r"\gamma",
            (1, 0.5, 1.5),
            "W/m^3",
            "(3.7)",
            "fluctuation energy lost in collisions",
        ),
    )
}

#: Numbers of a whole flow, attributes of a flow.
NUMBERS: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity("mass_flux", "Q", "Q", (1, 1.5, 0.5), "kg/m/s", "(3.26)", "mass flux per unit width"),
        Quantity("centre_of_mass", "h", "h", (0, 1, 0), "m", "(3.27)", "height of the centre of mass"),
        Quantity("mass_holdup", "M", "M", (1, 1, 0), "kg/m^2", "(3.27)", "mass per unit area of the base"),
        Quantity(
            "surface_temperature",
            "T_surface",
            r"T_{\mathrm{surface}}",
            (0, 1, 1),
            "m^2/s^2",
            "section 3.2",
            "granular temperature far above, or at the interface",
        ),
        Quantity(
            "base_temperature",
            "T_base",
            "T_0",
            (0, 1, 1),
            "m^2/s^2",
            "section 3.1",
            "granular temperature at the base",
        ),
        Quantity(
            "base_volume_fraction",
            "nu_base",
            r"\nu_0",
            (0, 0, 0),
            "1",
            "section 3.1",
            "volume fraction at the base",
        ),
        Quantity(
            "largest_volume_fraction",
            "nu_max",
            r"\nu_{\max}",
            (0, 0, 0),
            "1",
            "section 3.5",
            "largest volume fraction in the flow",
        ),
        Quantity("slip_velocity", "u_base", "u_0", (0, 0.5, 0.5), "m/s", "(3.15)", "velocity at the base"),
        Quantity(
            "depth",
            "depth",
            r"z_{1\%}",
            (0, 1, 0),
            "m",
            "section 3.3",
            "height above which the volume fraction is below 1 % of its maximum",
        ),
        Quantity(
            "interface_height",
            "H",
            "H",
            (0, 1, 0),
            "m",
            "section 3.7",
            "height of the interface (infinite on the half-line)",
        ),
        Quantity("mean_velocity", "U", "U", (0, 0.5, 0.5), "m/s", "Q/M", "mean velocity of the grains, Q/M"),
        Quantity(
            "surface_velocity",
            "u_surface",
            r"u_{\mathrm{surface}}",
            (0, 0.5, 0.5),
            "m/s",
            "(3.10)",
            "velocity far above, or at the interface",
        ),
        Quantity(
            "mean_volume_fraction",
            "nu_mean",
            r"\bar\nu",
            (0, 0, 0),
            "1",
            "",
            "mean volume fraction from the base to the depth",
        ),
        Quantity(
            "froude_number",
            "Fr",
            r"\mathrm{Fr}",
            (0, 0, 0),
            "1",
            "",
            "mean velocity over sqrt(g cos(theta) depth)",
        ),
        Quantity("angle", "angle", r"\theta", (0, 0, 0), "degree", "section 2", "inclination of the chute"),
    )
}

#: Names of the numbers by their symbols.
BY_SYMBOL = {quantity.symbol: name for name, quantity in NUMBERS.items() if quantity.symbol != name}

#: The numbers that place a flow on a curve.
PLACE = ("mass_flux", "centre_of_mass", "mass_holdup", "surface_temperature")

#: Numbers that show how far a flow keeps to the theory, attributes of :class:`chuteflow.steady.validity.Validity`.
VALIDITY: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity(
            "packing",
            "packing",
            r"\nu_{\max}/\nu^*",
            (0, 0, 0),
            "1",
            "section 2.1",
            "largest volume fraction over that of the densest packing of the law",
        ),
        Quantity(
            "slip_ratio",
            "slip_ratio",
            r"u_0/\sqrt{T_0}",
            (0, 0, 0),
            "1",
            "section 2.2",
            "slip velocity over the velocity of fluctuations at the base",
        ),
        Quantity(
            "knudsen_number",
            "knudsen_number",
            r"\mathrm{Kn}",
            (0, 0, 0),
            "1",
            "",
            "mean free path over the height of the centre of mass",
        ),
        Quantity(
            "density_turns",
            "density_turns",
            "n",
            (0, 0, 0),
            "1",
            "",
            "how often the volume fraction turns between rising and falling with height",
        ),
    )
}

#: What disturbances of a flow are measured in.
DISTURBANCES: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity("time", "t", "t", (0, 0.5, -0.5), "s", "section 3.1", "time"),
        Quantity("wavenumber", "k", "k", (0, -1, 0), "1/m", "", "wavenumber of a disturbance"),
        Quantity("growth", "growth", r"\sigma", (0, -0.5, 0.5), "1/s", "", "growth rate of a disturbance"),
        Quantity("frequency", "frequency", r"\omega", (0, -0.5, 0.5), "1/s", "", "angular frequency of a disturbance"),
        Quantity("wave_speed", "speed", "c", (0, 0.5, 0.5), "m/s", "", "speed of the crests of a disturbance"),
    )
}

QUANTITIES: dict[str, Quantity] = FIELDS | NUMBERS
#: All that has a scale.
SCALED: dict[str, Quantity] = QUANTITIES | DISTURBANCES

#: What is known of the grains, arguments of :class:`Scales`, and the SI units.
GRAINS = {"diameter": "m", "density": "kg/m^3", "gravity": "m/s^2"}
#: Quantities of mass that may be given by volume of the grains: their units times that of a density.
_BY_VOLUME = {"mass_flux": "m^2/s", "mass_holdup": "m"}


@dataclass(frozen=True)
class Scales:
    """Grain diameter (m), grain density (kg/m^3) and gravity (m/s^2), with which results take SI units.

    Each is a number in SI units, or a text with a unit such as "1 mm" or "2.5 g/cm^3". Lengths scale with the
    diameter d, time with sqrt(d/(g cos theta)), densities with that of a grain (section 3.1).

    Raises:
        InputError: for a scale that is not positive, or a unit of another kind.
    """

    diameter: float
    density: float
    gravity: float = 9.81

    if TYPE_CHECKING:

        def __init__(self, diameter: float | str, density: float | str, gravity: float | str = 9.81) -> None: ...

    def __post_init__(self) -> None:
        for name, unit in GRAINS.items():
            value = getattr(self, name)
            if isinstance(value, str) and bare(value):
                raise InputError(f"{name} = {value!r}: must be a number, in {unit}, or a text with a unit")
            object.__setattr__(self, name, positive_amount(name, value, unit))

    def factor(self, name: str, slope: float) -> float:
        """What the dimensionless quantity ``name`` on a chute of ``slope`` is multiplied with for SI units.

        Raises:
            InputError: for an unknown quantity, or a slope that is no number.
        """
        if name not in SCALED:
            raise InputError(f"unknown quantity {name!r}: choose one of {', '.join(SCALED)}")
        of_density, of_diameter, of_acceleration = SCALED[name].dimension
        acceleration = self.gravity / math.hypot(1.0, number("slope", slope))
        return self.density**of_density * self.diameter**of_diameter * acceleration**of_acceleration

    def dimensionless(self, name: str, amount: float | str, slope: float, what: str | None = None) -> float:
        """The quantity ``name`` on a chute of ``slope``, given in SI units as a number, or with a unit as in
        "0.5 kg/m/s".

        A mass flux may be given in m^2/s and a hold-up in m, which is then the volume of the grains alone. Messages
        call it ``what``.

        Raises:
            InputError: for an unknown quantity, text that is no amount, or a unit of another kind.
        """
        by, unit, density = self.factor(name, slope), SCALED[name].unit, 1.0
        if not isinstance(amount, str):
            return number(name, amount) / by
        if name in _BY_VOLUME and is_like(amount, _BY_VOLUME[name]):
            unit, density = _BY_VOLUME[name], self.density
        return read_si(what or name, amount, unit) * density / by
