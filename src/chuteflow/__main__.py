"""``python -m chuteflow``: the command line."""

import sys

from chuteflow.faces.cli import main

if __name__ == "__main__":
    sys.exit(main())
