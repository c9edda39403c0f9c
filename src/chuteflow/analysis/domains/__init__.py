"""Where flows exist, how many and of what kind, over two parameters of a chute."""

from chuteflow.analysis.domains.existence import exists_at
from chuteflow.analysis.domains.maps import Domain, domain
from chuteflow.analysis.domains.outlines import KINDS_OF_BOUNDARIES, Boundary, Region
from chuteflow.analysis.domains.plane import CODES, Axis, Plane

__all__ = ["CODES", "KINDS_OF_BOUNDARIES", "Axis", "Boundary", "Domain", "Plane", "Region", "domain", "exists_at"]
