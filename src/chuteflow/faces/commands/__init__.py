"""The commands: a new one is one module here with a ``command``, and one row in the table."""

#: Names and short descriptions, so that the list of commands is printed without importing any.
COMMANDS = {
    "solve": "Every steady flow of a chute at a flux, hold-up, depth or temperature.",
    "curve": "Every family of flows of a chute, with folds and other special points.",
    "hot": "The hot, dilute flow of a chute: scaling laws, existence and its range of slopes.",
    "figures": "Draw figures of the paper.",
}
