"""The table of constitutive laws. A new law is one small file that defines a Law, and one row here."""

from __future__ import annotations

from chuteflow.errors import InputError
from chuteflow.theory.constitutive import Law
from chuteflow.theory.extended import EXTENDED, JENKINS_BERZI
from chuteflow.theory.garzo_dufty import GARZO_DUFTY, GARZO_DUFTY_FOURIER
from chuteflow.theory.lun import LUN, LUN_FOURIER

LAWS: dict[str, Law] = {law.name: law for law in (LUN, LUN_FOURIER, GARZO_DUFTY, GARZO_DUFTY_FOURIER, EXTENDED, JENKINS_BERZI)}


def law(name: str) -> Law:
    """The law called ``name``.

    Raises:
        InputError: for an unknown name.
    """
    try:
        return LAWS[name]
    except (KeyError, TypeError):
        raise InputError(f"unknown closure {name!r}: choose one of {', '.join(sorted(LAWS))}") from None
