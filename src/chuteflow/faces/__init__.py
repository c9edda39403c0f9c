"""Plots, files, units and the command line: thin, no science in them."""
