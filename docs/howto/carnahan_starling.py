"""Table 1 of the paper with the radial distribution function of Carnahan & Starling (1969)."""

from chuteflow.theory.constitutive import Coefficients, Field, Law
from chuteflow.theory.lun import table_1


def carnahan_starling(nu: Field, free_fraction: Field, e: float, slope: float) -> Coefficients:
    """Table 1 with g0 = (1 - nu/2)/(1 - nu)^3, for which free_fraction = 1 - nu. ``slope`` does not enter."""
    del slope
    g0 = (1.0 - 0.5 * nu) / free_fraction**3
    log_slope = 3.0 / free_fraction - 0.5 / (1.0 - 0.5 * nu)  # g0'/g0
    return table_1(nu, g0, log_slope, e)


CARNAHAN_STARLING = Law(
    name="carnahan-starling",
    description="Lun et al. with the radial distribution of hard spheres below freezing, nu < 0.49",
    source="Carnahan & Starling 1969",
    densest=1.0,
    coefficients=carnahan_starling,
)
