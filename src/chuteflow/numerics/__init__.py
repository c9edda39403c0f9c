"""Numerical methods that know no granular physics."""
