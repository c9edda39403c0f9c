"""Solution branches: all flows of a chute at a condition, curves and their special points."""
