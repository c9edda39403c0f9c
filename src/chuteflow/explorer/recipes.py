"""The command lines and the lines of Python that give what the page shows and exports."""

from __future__ import annotations

from chuteflow.io import contract
from chuteflow.steady.chute import Chute
from chuteflow.steady.quantities import Scales


def recipes(chute: Chute, flux: float | str, scales: Scales | None) -> dict[str, str]:
    """``command`` and ``python``: each writes the tables of profiles and of the curve that the page exports.

    The flux may be a text that stands for one.
    """
    given = contract.chute_object(chute)
    options = " ".join(
        f"--{short} {value if isinstance(value, str) else repr(value)}" for short, value in given.items()
    )
    grains = "" if scales is None else f" --diameter {scales.diameter} --density {scales.density}"
    arguments = ", ".join(f"{name}={value!r}" for name, value in chute.as_dict().items())
    lines = [
        "import chuteflow",
        "",
        f"chute = chuteflow.Chute({arguments})",
        f"flows = chuteflow.flows(chute, Q={flux})",
        "curve = chuteflow.curve(chute)",
    ]
    wanted = ""
    if scales is not None:
        lines.append(f"grains = chuteflow.Scales(diameter={scales.diameter}, density={scales.density})")
        wanted = ", scales=grains"
    lines += [f'chuteflow.save({what}, "{_table(name)}"{wanted})' for what, name in _TABLES.items()]
    return {
        "command": f"chuteflow solve {options} --flux {flux}{grains} --save {_table('profiles')}\n"
        f"chuteflow curve {options}{grains} --save {_table('curve')}",
        "python": "\n".join(lines),
    }


_TABLES = {"flows": "profiles", "curve": "curve"}


def _table(what: str) -> str:
    return f"chuteflow-{what}.csv"
