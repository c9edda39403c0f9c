"""What people ask: all flows at a flux, curves and their special points."""
