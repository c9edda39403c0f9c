"""Studies of very many chutes: designs, an engine that treats them in batches, and a store that survives all ends."""
