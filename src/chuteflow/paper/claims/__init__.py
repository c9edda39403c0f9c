"""The statements of the paper that can be tested, each computed here and given a verdict.

``CLAIMS`` holds them by id; ``check()`` computes them one at a time. A new claim is one decorated function in a module
of its subject; a new subject is one module here, and one name in the line that imports them, in the order of the paper.
"""

# Imported in the order of the paper, in which they enter their claims.
from chuteflow.paper.claims import model  # noqa: F401, I001
from chuteflow.paper.claims import far_field, three_flows, flow_curves, stability  # noqa: F401
from chuteflow.paper.claims import productive_flows, interface  # noqa: F401
from chuteflow.paper.claims import hot_flows, domains, heat_flux  # noqa: F401
from chuteflow.paper.claims.registry import CLAIMS, VERDICTS, Claim, ClaimResult, check, matching, shown

__all__ = ["CLAIMS", "VERDICTS", "Claim", "ClaimResult", "check", "matching", "shown"]
