"""Folds, onsets of density inversion and changes of interior, followed through a second parameter."""
