"""The command line ``chuteflow``: finds the command, and turns every outcome into an exit code.

0 done, also when the answer is that there is no flow; 2 bad input and 1 failure, each with one line on
standard error; 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper
from typing import Any, TextIO

import click

from chuteflow import __version__
from chuteflow.cli import interrupts
from chuteflow.cli.commands import COMMANDS
from chuteflow.cli.progress import Progress
from chuteflow.errors import ChuteflowError, InputError
from chuteflow.threads import limit_process

DONE, FAILED, BAD_INPUT = 0, 1, 2


class Commands(click.Group):
    """The table of commands, each imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name."""
        if cmd_name not in COMMANDS:
            return None
        return import_module(f"chuteflow.cli.commands.{cmd_name.replace('-', '_')}").command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the first argument names."""
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            raise click.UsageError(f"there is no command {args[0]!r}: choose one of {', '.join(COMMANDS)}", ctx)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an interrupt passes by click, which would add an empty line."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise interrupts.Interrupted(str(error)) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=Commands,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Each command explains itself: chuteflow solve --help",
)
@click.version_option(__version__, prog_name="chuteflow")
def chuteflow() -> None:
    """The steady, fully developed flows of grains that an inclined chute can carry."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, by default on the arguments of the process, and return its exit code."""
    if "multiprocessing.spawn" in sys.modules:
        # This may be a worker that runs the script of its parent again.
        from chuteflow.processes import require_main_guard

        require_main_guard()
    if arguments is None:
        limit_process()
    _prepare_streams()
    with interrupts.Interrupts():
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        with interrupts.nothing_but_interrupts():
            code = chuteflow.main(arguments, prog_name="chuteflow", standalone_mode=False)
            sys.stdout.flush()
        return code if isinstance(code, int) else DONE
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "chuteflow"
        return _complain(f"{error.format_message().rstrip('.')} (see {where} --help)", BAD_INPUT)
    except (click.ClickException, InputError) as error:
        return _complain(str(error), BAD_INPUT)
    except ChuteflowError as error:
        return _complain(str(error), FAILED)
    except (click.Abort, KeyboardInterrupt, interrupts.Interrupted) as error:
        interrupts.mark_reported()
        Progress().clear()  # of a command that was interrupted
        return _complain(str(error) or "interrupted", interrupts.INTERRUPTED)
    except SystemExit:
        # This is how click ends where whoever read has gone.
        _abandon(sys.stdout)
        return FAILED
    except BrokenPipeError:
        _abandon(sys.stdout)
        return FAILED
    except OSError as error:
        _abandon(sys.stdout)
        return _complain(f"cannot write the output: {error.strerror or error}", FAILED)
    except MemoryError:
        return _complain("out of memory: ask for less, such as fewer points, or give it more", FAILED)
    except RecursionError:
        return _complain("the input is nested too deeply", BAD_INPUT)


def _prepare_streams() -> None:
    """Make sure of both streams: one that is closed takes everything, and one that knows no Greek its escapes."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # It also keeps files opened later from the number of the closed stream.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        stream = getattr(sys, name)
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _abandon(stream: TextIO) -> None:
    """Let what is left in the buffer of ``stream`` go to nowhere, so that it does not fail again at exit."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _complain(message: str, code: int) -> int:
    try:
        click.echo("chuteflow: " + " ".join(message.split()), err=True)
    except OSError:
        _abandon(sys.stderr)
    return code
