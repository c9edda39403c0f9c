"""Where flows exist, how many and of what kind, over two parameters of a chute."""

from chuteflow.maps.domain import Domain, domain
from chuteflow.maps.existence import exists_at
from chuteflow.maps.outlines import KINDS_OF_BOUNDARIES, Outline, Region
from chuteflow.maps.plane import CODES, ParameterAxis, ParameterPlane

__all__ = [
    "CODES",
    "KINDS_OF_BOUNDARIES",
    "Domain",
    "Outline",
    "ParameterAxis",
    "ParameterPlane",
    "Region",
    "domain",
    "exists_at",
]
