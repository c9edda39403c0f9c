"""``chuteflow explore``: a page to try every parameter by hand."""

from __future__ import annotations

import signal

import click

from chuteflow.cli import options
from chuteflow.cli.commands import COMMANDS
from chuteflow.extras import require

#: Addresses that stand for all of this machine's, under names that cannot be known.
_ANY = ("0.0.0.0", "::")


@click.command("explore", help=COMMANDS["explore"])
@click.option("--port", type=click.IntRange(0, 65535), help="Port; 8765 or another free one by default, 0 for any.")
@options.option("--host", metavar="ADDRESS", help="Address to listen at; 127.0.0.1, only this machine, by default.")
@click.option("--no-browser", is_flag=True, help="Do not open a browser.")
def command(port: int | None, host: str | None, no_browser: bool) -> None:
    """Serve until interrupted."""
    for name in ("starlette", "uvicorn"):
        require(name, "explore", "the explorer")
    import uvicorn

    from chuteflow.explorer.connections import Connection, Server
    from chuteflow.explorer.server import LOOPBACK, application, bound

    address = host or "127.0.0.1"
    listener = bound(address, port)
    number = listener.getsockname()[1]
    shown = f"[{address}]" if ":" in address else address
    page = f"http://{shown}:{number}/"
    hosts = LOOPBACK
    if address not in LOOPBACK:
        click.echo(f"chuteflow: anyone who reaches {address} can use this server", err=True)
        hosts = None if address in _ANY else (*LOOPBACK, address)
    click.echo(f"The explorer is at {page}   (Ctrl-C ends it)")
    click.echo("Its first answers come in a few seconds, or in about half a minute where the search is compiled first")
    served = application(hosts)
    settings = uvicorn.Config(
        served, http=Connection, ws="none", log_level="error", lifespan="on", timeout_graceful_shutdown=1
    )
    if not no_browser:
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
