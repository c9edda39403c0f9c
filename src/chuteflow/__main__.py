"""``python -m chuteflow`` and ``chuteflow``: the command line."""

import sys


def run() -> int:
    """Run the command line on the arguments of this process, and return its exit code.

    Interrupts are taken care of before anything large is imported, and up to the end of the process.
    """
    try:
        from chuteflow.cli import interrupts

        with interrupts.Interrupts(to_the_end=True):
            from chuteflow.cli.program import main

            return main()
    except KeyboardInterrupt:
        from chuteflow.cli import interrupts

        return interrupts.report()


if __name__ == "__main__":
    sys.exit(run())
