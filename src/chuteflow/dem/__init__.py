"""Simulations of single grains with LAMMPS: the scene, its run, averages over layers, and the theory beside them."""
