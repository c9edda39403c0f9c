"""The interface of a constitutive law, and the combinations of it that the steady problem needs.

# notation: nu volume fraction, e restitution, s slope tan(theta), p = g1 T normal stress,
# y = q/(p sqrt(T)) heat flux over normal stress and thermal speed.

A law gives p = g1(nu) T, eta = g2(nu) sqrt(T), K = g3(nu) sqrt(T), K* = g4(nu) T^(3/2) and
gamma = g5(nu) T^(3/2) (2.7). The steady problem in the overburden coordinate p needs of them only
the functions of nu in :class:`Reduced`.

The heat flux (3.6) is q = nu (g3 sqrt(T) dT/dp - g4 T^(3/2) dnu/dp). With Gamma(nu), dGamma/dnu = g4/g3, it
is the gradient of one potential, theta = ln T - Gamma(nu):

    y = (g3 nu/g1) dtheta/dp

theta is uniform wherever there is no heat flux, however the density varies.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import lru_cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from chuteflow.checks import shorten
from chuteflow.errors import InputError
from chuteflow.numerics.complex_step import stepped

#: An array of values at given states.
Field = NDArray[Any]

#: Volume fraction above which grains form clusters and chains, and dissipation is less than of single collisions
#: (Jenkins 2007).
CLUSTERED = 0.49
#: Contact value in Richman's A(nu): d = d_w in (2.12).
WALL_CONTACT = np.pi / (12.0 * np.sqrt(2.0))


@dataclass(frozen=True)
class Coefficients:
    """Values of a law at given nu, in forms that are finite at nu = 0; arrays of one shape, or single numbers.

    ``radial`` is g0; ``compressibility`` is G = g1/nu and ``compressibility_slope`` dG/dnu;
    ``viscosity`` g2; ``conductivity`` g3; ``density_conductivity`` g4;
    ``dissipation`` g5/nu^2; ``bulk_viscosity`` g6. A law whose g4 grows like 1/nu where dilute also gives
    ``density_flux`` = nu g4.
    """

    radial: Field
    compressibility: Field
    compressibility_slope: Field
    viscosity: Field
    conductivity: Field
    density_conductivity: Field
    dissipation: Field
    bulk_viscosity: Field
    density_flux: Field | None = None


@dataclass(frozen=True)
class Unknown:
    """The function of a law that is known by its description alone, such as that of a file written elsewhere."""

    name: str

    def __call__(self, nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
        """Nothing.

        Raises:
            InputError: always, saying what is missing.
        """
        raise InputError(
            f"closure {self.name!r} is not registered here: what was saved can be read, but nothing more can be "
            "computed with it before it is, or before it is given as FILE.py:NAME"
        )


@dataclass(frozen=True)
class Law:
    """A constitutive law.

    ``coefficients(nu, free_fraction, e, slope)`` takes nu and ``free_fraction`` = 1 - nu/nu* apart, so that no digit is
    lost near the densest packing nu* = ``densest``, where the radial distribution function diverges. It is a plain
    function, or a frozen dataclass whose fields are the parameters of the law, see
    :class:`chuteflow.theory.formula.Formula`: laws with equal values of them are equal.
    ``knows_slope`` is for laws whose dissipation depends on the shear rate, which in a fully developed flow
    is a function of nu and the slope. ``breaks`` are the volume fractions at which a coefficient is not smooth, or
    a function of e and the slope that gives them; ``valid`` is where the law was meant to hold, in words; ``spec`` is
    the text by which it was requested, where that was not its name, see :mod:`chuteflow.theory.laws`.

    ``coefficients`` may have methods: ``breaks(e, slope)``, and ``at_shear(nu, free_fraction, e, rate)``, the
    coefficients where the shear rate over nu sqrt(T) is ``rate``, for disturbed flows of a law that ``knows_slope``.
    """

    name: str
    description: str
    source: str
    densest: float
    coefficients: Callable[[Field, Field, float, float], Coefficients]
    knows_slope: bool = False
    breaks: tuple[float, ...] | Callable[[float, float], tuple[float, ...]] = ()
    valid: str = ""
    spec: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        try:
            hash(self)
        except TypeError as error:
            raise InputError(
                f"closure {self.name!r}: {error}: what is remembered of a law is found by its values, so that its "
                "function must be a plain one or a frozen dataclass, and its breaks a tuple or a function"
            ) from None

    def __str__(self) -> str:
        return self.spec or self.name

    @property
    def known(self) -> bool:
        """Whether its function is at hand."""
        return not isinstance(self.coefficients, Unknown)

    @property
    def dense_limit(self) -> float:
        """The volume fraction up to which the law is meant."""
        return getattr(self.coefficients, "dense_limit", CLUSTERED)

    @property
    def smooth(self) -> bool:
        """Whether its coefficients are smooth at every density, restitution and slope."""
        return not self.breaks and getattr(self.coefficients, "smooth", True)

    @classmethod
    def of(cls, name: str, description: str, source: str, formula: Any, valid: str = "") -> Law:
        """The law of a ``formula``, a dataclass of parameters that also has ``densest`` and ``breaks``."""
        knows_slope = hasattr(formula, "at_shear")
        return cls(name, description, source, formula.densest, formula, knows_slope, valid=valid)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name; none where the law is a plain function."""
        formula: Any = self.coefficients
        return {field.name: getattr(formula, field.name) for field in fields(formula)} if is_dataclass(formula) else {}

    def configured(self, **settings: Any) -> Law:
        """The law with other values of some of its parameters.

        Raises:
            InputError: for a parameter that it does not have, or a value out of range.
        """
        for name in settings:
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "it has none"
                raise InputError(f"closure {self.name!r} has no parameter {name!r}: choose from {known}")
        if not settings:
            return self
        formula: Any = replace(cast(Any, self.coefficients), **settings)
        said = ",".join(f"{name}={value}" for name, value in settings.items())
        spec = f"{self},{said}" if "=" in str(self).rpartition(":")[2] else f"{self}:{said}"
        return replace(Law.of(self.name, self.description, self.source, formula, self.valid), spec=spec)

    def stepped(self, name: str) -> Law:
        """The law with one of its parameters an imaginary step further (:mod:`chuteflow.numerics.complex_step`).

        Its breaks stay where they are: the coefficients are continuous there.
        """
        formula: Any = copy(self.coefficients)
        value = getattr(formula, name)
        # No parameter that is a number has a default of its own other than the densest packing.
        object.__setattr__(formula, name, stepped(self.densest if value is None else value))
        object.__setattr__(formula, "breaks", getattr(self.coefficients, "breaks", self.breaks))
        return replace(self, coefficients=formula, densest=formula.densest)

    @lru_cache(maxsize=1024)  # noqa: B019 - laws are few
    def breaks_at(self, e: float, slope: float) -> tuple[float, ...]:
        """The volume fractions, ascending, at which a coefficient is not smooth at this restitution and slope.

        Raises:
            InputError: for one that is not between 0 and the densest packing.
        """
        own: Any = getattr(self.coefficients, "breaks", self.breaks)
        try:
            given: Any = own(e, slope) if callable(own) else own
            places = sorted(float(nu) for nu in given)
        except Exception as error:  # noqa: BLE001 - a law of the user may raise anything
            said = f"{type(error).__name__}: {error}"
            raise InputError(f"closure {self}: its breaks fail at e = {e}, slope = {slope}: {said}") from None
        for nu in places:
            if not 0.0 < nu < np.real(self.densest):
                raise InputError(
                    f"closure {self.name!r} has a break at nu = {nu:g}: must be above 0 and below {self.densest:g}"
                )
        return tuple(places)

    def at(self, x: Field, e: float, slope: float) -> tuple[Field, Field, Coefficients]:
        """nu, 1 - nu/nu* and the coefficients at x = nu/(1 - nu/nu*).

        Raises:
            InputError: where the law's function fails, naming it and the densities.
        """
        free_fraction = 1.0 / (1.0 + x / self.densest)
        nu = x * free_fraction
        return nu, free_fraction, self.called(self.coefficients, nu, free_fraction, e, slope)

    def of_density(self, nu: Field, e: float, slope: float, rate: Field | None = None) -> Coefficients:
        """The coefficients at ``nu``; of a law that ``knows_slope`` where the shear rate over nu sqrt(T) is ``rate``,
        if one is given.

        Raises:
            InputError: where the law's function fails, naming it and the densities.
        """
        free_fraction = 1.0 - nu / self.densest
        if rate is None or not self.knows_slope:
            return self.called(self.coefficients, nu, free_fraction, e, slope)
        formula: Any = self.coefficients
        return self.called(formula.at_shear, nu, free_fraction, e, rate)

    def called(self, function: Callable[..., Coefficients], nu: Field, *others: Any) -> Coefficients:
        """What a ``function`` of the law gives at ``nu`` and the ``others``: free_fraction, e, and slope or rate.

        Raises:
            InputError: where it fails, naming it and the densities.
        """
        try:
            # What is no number is told with its density by those who ask.
            with np.errstate(all="ignore"):
                return _spread(function(nu, *others), np.shape(nu))
        except InputError:
            raise
        except Exception as error:  # noqa: BLE001 - a law of the user may raise anything
            said = f"{type(error).__name__}: {error}"
            raise InputError(f"closure {self}: its function fails at {_where(nu, others[1])}: {said}") from None


@dataclass(frozen=True)
class Reduced:
    """What the steady problem needs of a law: functions of nu that are finite at nu = 0, arrays of one shape.

    - ``conduction`` = g3 nu/g1, with which y = conduction dtheta/dp;
    - ``drift`` = nu g4/g3, with theta = ln T - Gamma and dGamma/dln nu = drift; where dilute it is -b, and b is 0 but
      for laws whose g4 grows like 1/nu; ``coupling`` = (drift + b)/nu;
    - ``loss`` = g5/(nu g1) and ``work`` = g1/(nu g2): dissipation minus production is loss - s^2 work;
    - ``shear`` = g1/g2, with du/dz = s shear sqrt(T) (3.10);
    - ``wall_shear`` = A g1/g2, of the slip condition (3.16);
    - ``radial`` = g0, ``compressibility`` = G = g1/nu and ``stiffness`` = d ln g1 / d ln nu.
    """

    conduction: Field
    drift: Field
    coupling: Field
    loss: Field
    work: Field
    shear: Field
    wall_shear: Field
    radial: Field
    compressibility: Field
    stiffness: Field


def reduce(law: Law, x: Field, e: float, slope: float) -> Reduced:
    """Combine the coefficients of ``law`` at x = nu/(1 - nu/nu*) >= 0 into :class:`Reduced`."""
    nu, _, g = law.at(x, e, slope)
    big_g = g.compressibility
    if g.density_flux is None:
        coupling = g.density_conductivity / g.conductivity
        drift = coupling * nu
    else:
        drift = g.density_flux / g.conductivity
        empty = nu == 0.0
        coupling = np.where(empty, 0.0, (drift + dilute_drift(law, e, slope)) / np.where(empty, 1.0, nu))
    # A g1 with (2.12): nu A is finite at nu = 0, where A alone is not.
    nu_contact = nu * (1.0 + WALL_CONTACT) + WALL_CONTACT * 5.0 / (8.0 * g.radial)
    return Reduced(
        conduction=g.conductivity / big_g,
        drift=drift,
        coupling=coupling,
        loss=g.dissipation / big_g,
        work=big_g / g.viscosity,
        shear=nu * big_g / g.viscosity,
        wall_shear=big_g * nu_contact / g.viscosity,
        radial=g.radial,
        compressibility=big_g,
        stiffness=1.0 + nu * g.compressibility_slope / big_g,
    )


def dilute_drift(law: Law, e: float, slope: float) -> Any:
    """b, the limit of -nu g4/g3 where dilute, for one e or many: 0 but for laws whose g4 grows like 1/nu."""
    return _dilute_drift(law, e, slope) if np.ndim(e) or np.ndim(slope) else _drift_of_one(law, e, slope)


def _dilute_drift(law: Law, e: Any, slope: Any) -> Any:
    _, _, g = law.at(np.zeros(1), e, slope)
    if g.density_flux is None:
        return 0.0
    b = -g.density_flux / g.conductivity
    return b if np.ndim(e) else b[0]


_drift_of_one = lru_cache(maxsize=64)(_dilute_drift)


def require_limit(law: Law, e: float, slope: float, what: str) -> None:
    """Check that the temperature has a limit far above.

    Raises:
        InputError: where it grows without bound as the density vanishes; ``what`` needs the limit.
    """
    b = dilute_drift(law, e, slope)
    if b != 0.0:
        raise InputError(
            f"closure {law}: T goes like p^({-b / (1.0 - b):.3g}) far above and has no limit there, which {what}: "
            "take the Fourier form of the closure"
        )


def require_height(law: Law, e: float, slope: float) -> None:
    """Check that the height of the centre of mass is finite on the half-line.

    Raises:
        InputError: where the temperature grows too fast far above.
    """
    if np.any(dilute_drift(law, e, slope) >= 0.5):
        raise InputError(
            f"closure {law} at e = {e:g}: T grows so fast far above that h is infinite: "
            "take a larger e, the surface interface or the Fourier form of the closure"
        )


def fingerprint(law: Law, e: float, slope: float) -> list[float]:
    """Values of ``law`` at a few densities, by which it is known again, whatever its name."""
    x = np.append(0.0, np.geomspace(1e-2, 1e2, _KNOWN_BY))
    _, _, g = law.at(x, e, slope)
    # nu g4 is told by g4.
    values = [getattr(g, name) for name in FUNCTIONS]
    found = np.concatenate([np.broadcast_to(value, x.shape) for value in values])
    return [law.densest, *np.where(np.isfinite(found), found, 0.0).tolist()]


def digest(law: Law, e: float, slope: float) -> str:
    """What tells the values of ``law`` from those of another, to 9 digits, whatever its name."""
    rounded = [f"{value:.9e}" for value in fingerprint(law, e, slope)]
    return hashlib.sha256(" ".join(rounded).encode()).hexdigest()


#: The functions of a law, by the fields of :class:`Coefficients`, and whether each must be positive.
FUNCTIONS = {
    "radial": ("g0", True),
    "compressibility": ("g1/nu", True),
    "compressibility_slope": ("d(g1/nu)/dnu", False),
    "viscosity": ("g2", True),
    "conductivity": ("g3", True),
    "density_conductivity": ("g4", False),
    "dissipation": ("g5/nu^2", False),
    "bulk_viscosity": ("g6", False),
}
#: What they must be above where that is not 0 or nothing: dissipation may be 0.
_LEAST_OF = {"dissipation": float(np.nextafter(0.0, -1.0))}
#: Densities by which a law is known again, and at which it is tried.
_KNOWN_BY = 25
_TRIED = np.append(0.0, np.logspace(-4.0, 9.0, 261))


# Keyed by the law itself, as its tables are.
@lru_cache(maxsize=256)
def require_positive(law: Law, e: float, slope: float) -> None:
    """Check that a law gives numbers at every density, and that pressure, viscosity and conductivity are positive.

    Raises:
        InputError: where ``law`` loses its meaning at restitution ``e``, naming the function and the density.
    """
    _require_positive(law, e, slope if law.knows_slope else 1.0)


# Maps ask for thousands of chutes of the same grains.
@lru_cache(maxsize=1024)
def _require_positive(law: Law, e: float, slope: float) -> None:
    if not (isinstance(law.densest, (int, float)) and 0.0 < law.densest <= 1.0):
        raise InputError(
            f"closure {law}: its densest packing is {shorten(law.densest)}: must be a number above 0, at most 1"
        )
    nu, _, g = law.at(_TRIED, e, slope)
    if not isinstance(g, Coefficients):
        raise InputError(f"closure {law}: its function returns a {type(g).__name__}: must be Coefficients")
    functions = FUNCTIONS if g.density_flux is None else FUNCTIONS | {"density_flux": ("nu g4", False)}
    table = np.empty((len(functions), len(nu)))
    for row, (name, (symbol, _)) in zip(table, functions.items(), strict=True):
        values = getattr(g, name)
        if not isinstance(values, (np.ndarray, float, int)) or np.asarray(values).dtype.kind not in "fi":
            kind = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
            raise InputError(
                f"closure {law}: {symbol} ({name}) is of the type {kind} at {_where(nu, e)}: must be an array of real "
                "numbers"
            )
        if np.shape(values) not in ((), nu.shape):
            raise InputError(
                f"closure {law}: {symbol} ({name}) has the shape {np.shape(values)} for nu of the shape {nu.shape} at "
                f"{_where(nu, e)}: must be the same"
            )
        row[:] = values
    least = np.array([_LEAST_OF.get(name, 0.0 if positive else -np.inf) for name, (_, positive) in functions.items()])
    bad = ~((table > least[:, None]) & (table < np.inf))
    # A flux along the density gradient may grow like 1/nu where dilute.
    bad[list(functions).index("density_conductivity"), 0] = False
    for i in np.flatnonzero(bad.any(axis=1)).tolist():
        symbol, positive = list(functions.values())[i]
        at = int(np.argmax(bad[i]))
        what = f"no positive {symbol}" if positive else f"no {symbol} that makes sense"
        raise InputError(
            f"closure {str(law)!r} has {what} at restitution e = {e}: it is {table[i, at]:g} at nu = {nu[at]:.6g}; "
            "take a larger e or another closure"
        )
    law.breaks_at(e, slope)


def _spread(found: Coefficients, shape: tuple[int, ...]) -> Coefficients:
    """Coefficients of which some may be single numbers, which hold at every density, as arrays."""
    if not shape or not isinstance(found, Coefficients):
        return found
    single = {name: value for name, value in vars(found).items() if isinstance(value, (float, int))}
    return replace(found, **{name: np.full(shape, value) for name, value in single.items()}) if single else found


def _where(nu: Field, e: float) -> str:
    low, high = float(np.min(np.real(nu))), float(np.max(np.real(nu)))
    return f"nu = {low:.6g}, e = {e}" if low == high else f"nu from {low:.6g} to {high:.6g}, e = {e}"
