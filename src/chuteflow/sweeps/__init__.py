"""Studies of very many chutes: designs, an engine that treats them side by side, and a store that survives anything."""
