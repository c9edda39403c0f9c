"""The formulas of the paper as pure functions. Knows no solver."""
