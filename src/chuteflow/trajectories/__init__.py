"""The initial value problem from the surface down, on a grid of trajectories that refines itself."""
