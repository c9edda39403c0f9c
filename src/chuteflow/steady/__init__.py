"""Theory made into problems for the numerics: the steady problem, its surfaces, its results."""
