"""The errors that the package raises on purpose."""


class ChuteflowError(Exception):
    """Base of all errors raised on purpose; the message is one sentence for the user."""


class InputError(ChuteflowError, ValueError):
    """An input is missing, contradictory or out of range; says what was given and what is allowed."""


class SolveError(ChuteflowError, RuntimeError):
    """A computation did not reach its tolerance; says what to try next."""
