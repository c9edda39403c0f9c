"""The former place of :mod:`chuteflow.io.units`, under which its names remain."""

from chuteflow.io.units import FlowInUnits, in_si, read_amount, read_si

__all__ = ["FlowInUnits", "in_si", "read_amount", "read_si"]
