"""``python -m chuteflow`` and ``chuteflow``: the command line."""

import gc
import sys

#: Objects made before unreachable ones are looked for. Nearly all that a command makes are modules, classes and
#: compiled loops, which stay to its end: to look for others more often takes a fifth of the time of ``solve``.
_OBJECTS = 100_000


def run() -> int:
    """Run the command line on the arguments of this process, and return its exit code.

    Interrupts are taken care of before anything large is imported, and up to the end of the process.
    """
    gc.set_threshold(_OBJECTS)
    try:
        from chuteflow.cli import interrupts

        with interrupts.Interrupts(to_the_end=True):
            from chuteflow.cli.program import main

            return main()
    except KeyboardInterrupt:
        from chuteflow.cli import interrupts

        return interrupts.report()
    finally:
        gc.freeze()  # the end of the process frees the memory without visiting each object


if __name__ == "__main__":
    sys.exit(run())
