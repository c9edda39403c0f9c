"""Where flows exist, how many and of what kind, over two parameters of a chute."""

from chuteflow.analysis.domains.existence import exists_at
from chuteflow.analysis.domains.maps import Domain, domain
from chuteflow.analysis.domains.plane import Axis, Plane

__all__ = ["Axis", "Domain", "Plane", "domain", "exists_at"]
