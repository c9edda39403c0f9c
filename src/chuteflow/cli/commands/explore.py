"""``chuteflow explore``: a page to try every parameter by hand."""

from __future__ import annotations

import signal
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.errors import InputError
from chuteflow.extras import require

if TYPE_CHECKING:
    from chuteflow.steady.quantities import Scales

#: Addresses that stand for all of this machine's, under names that cannot be known.
_ANY = ("0.0.0.0", "::")
#: The flux of a page where none is given.
_FLUX = 3.0
_EPILOG = (
    "The page opens with what is given of the chute. --export writes it instead as one file that needs no server: "
    "every flow of the chute in the range searched, with a slider for the flux.\n\n"
    "Example: chuteflow explore --case paper-dissipative --export page.html"
)


@click.command("explore", help=COMMANDS["explore"], epilog=_EPILOG)
@options.chute_options
@options.option("--flux", "--mass-flux", metavar="AMOUNT", help="Mass flux Q per unit width; 3 by default.")
@options.option("--export", metavar="FILE", help="Write one page that needs no server to FILE: .html.")
@click.option(
    "--data",
    metavar="FILE",
    multiple=True,
    help="Measurements as `chuteflow fit` reads them, or a particle run of `chuteflow dem read`, to draw behind the "
    "flows; as often as there are files.",
)
@options.search_range_options
@click.option("--port", type=click.IntRange(0, 65535), help="Port; 8765 or another free one by default, 0 for any.")
@options.option("--host", metavar="ADDRESS", help="Address to listen at; 127.0.0.1, only this machine, by default.")
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
@options.quiet_option
def command(**given: Any) -> None:
    """Write a page, or serve one until interrupted."""
    if given["export"] is None:
        state = _first_state(given)
        _serve(given, state, _data(given))
    else:
        _export(given)


# --- one file ---------------------------------------------------------------------------------------------------------


def _export(given: dict[str, Any]) -> None:
    for name in ("port", "host"):
        if given[name] is not None:
            raise InputError(f"--export writes a file that nobody serves: leave --{name} away")
    chute = options.chute(given)
    scales = _scales(given)
    from chuteflow.io.writing import require_writable, write_whole

    path = given["export"]
    require_writable(path, (".html",))
    flux = _flux(given, chute.slope, scales)
    within = options.search(given, chute.slope, scales)
    data = _data(given, chute.slope)
    from chuteflow.explorer.standalone import standalone

    write_whole(path, standalone(chute, flux, scales, data=data, **within))
    click.echo(f"{path}: one page of this chute, with every flow in the range searched; it needs no server")


def _data(given: dict[str, Any], slope: float | None = None) -> list[dict[str, Any]]:
    """What was measured, from the files of the options."""
    if not given["data"]:
        return []
    from chuteflow.explorer.data import read_data

    return read_data(given["data"], slope=given["slope"] if slope is None else slope, scales=_scales(given))


def _scales(given: dict[str, Any]) -> Scales | None:
    """The scales of the options; the page has the gravity of the Earth.

    Raises:
        InputError: for another gravity.
    """
    from chuteflow.steady.quantities import Scales

    found = options.scales(given)
    if found is not None and found.gravity != Scales(found.diameter, found.density).gravity:
        raise InputError(f"gravity = {found.gravity:g}: the explorer has that of the Earth alone, leave it away")
    return found


def _flux(given: dict[str, Any], slope: float, scales: Scales | None) -> float:
    from chuteflow.checks import number_in
    from chuteflow.explorer.queries import FLUX_RANGE

    if given["flux"] is None:
        return _FLUX
    return number_in("--flux", str(options.amount(given, "flux", "mass_flux", slope, scales)), *FLUX_RANGE)


# --- the server -------------------------------------------------------------------------------------------------------


def _first_state(given: dict[str, Any]) -> dict[str, Any]:
    """What of the chute is given, as the page opens with it.

    Raises:
        InputError: for what no chute has, and for what the page cannot show.
    """
    for name in ("search_temperature", "largest_holdup"):
        if given[name] is not None:
            raise InputError(f"--{name.replace('_', '-')} is the range of a page that is written: give --export too")
    if given["base"] not in (None, "richman"):
        raise InputError(f"--base {given['base']}: the explorer has the base richman; --export takes any")
    scales = _scales(given)
    state = _material(given)
    if given["flux"] is not None:
        if "slope" not in state:
            raise InputError("--flux needs the chute it flows on: give --slope or --angle too")
        state["Q"] = _flux(given, float(state["slope"]), scales)
    if scales is not None:
        state |= {"si": "1", "d": repr(round(1e3 * scales.diameter, 12)), "rho": repr(scales.density)}
    return state


def _material(given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters and names of the chute as far as they are given, with those of the page in the place of others.

    Raises:
        InputError: for a value out of range, or a law that is a file.
    """
    from chuteflow.explorer.queries import PRESETS
    from chuteflow.parameters import BY_KEY
    from chuteflow.theory.laws import runs_code

    first = PRESETS[0].state
    # The same checks as of a whole chute: what is not given is as the page has it.
    lacking = {key: first[key] for key in BY_KEY if given[key] is None and (key != "slope" or given["angle"] is None)}
    whole = options.chute({**given, **lacking})
    if runs_code(str(whole.closure)):
        raise InputError(f"--closure {whole.closure}: a page may not run files; --export takes any law")
    values = {key: getattr(whole, BY_KEY[key].name) for key in BY_KEY if key not in lacking}
    return values | {name: str(getattr(whole, name)) for name in options.words(given) if name != "base"}


def _serve(given: Mapping[str, Any], state: Mapping[str, Any], data: list[dict[str, Any]]) -> None:
    for name in ("starlette", "uvicorn"):
        require(name, "explore", "the explorer")
    from urllib.parse import urlencode

    import uvicorn

    from chuteflow.explorer.connections import Connection, Server
    from chuteflow.explorer.server import LOOPBACK, application, bind_socket

    address = given["host"] or "127.0.0.1"
    listener = bind_socket(address, given["port"])
    number = listener.getsockname()[1]
    shown = f"[{address}]" if ":" in address else address
    page = f"http://{shown}:{number}/{'?' if state else ''}{urlencode(state)}"
    hosts = LOOPBACK
    if address not in LOOPBACK:
        click.echo(f"chuteflow: anyone who reaches {address} can use this server", err=True)
        hosts = None if address in _ANY else (*LOOPBACK, address)
    click.echo(f"The explorer is at {page}   (Ctrl-C ends it)")
    if not given["quiet"]:
        click.echo(
            "Its first answers come in a few seconds, or in about half a minute where the search is compiled first"
        )
    served = application(hosts, data=data, first=state)
    settings = uvicorn.Config(
        served, http=Connection, ws="none", log_level="error", lifespan="on", timeout_graceful_shutdown=1
    )
    if not given["no_browser"]:
        _open_when_served(page)
    server = Server(settings, served.state.scheduler.close)
    # Also before and after the server takes signals itself: interrupts interrupt neither its start nor its end.
    signal.signal(signal.SIGINT, server.handle_exit)
    server.run(sockets=[listener])
    click.echo("The explorer has ended")


def _open_when_served(page: str) -> None:
    """The socket listens already, so that a browser opened now waits for the first answer."""
    import threading
    import webbrowser

    threading.Thread(target=webbrowser.open, args=(page,), daemon=True).start()
