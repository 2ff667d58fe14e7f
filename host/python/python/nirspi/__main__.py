"""The program ``nirspi``: the script of this name, and ``python -m nirspi``."""

import os
import sys

from ._nirspi import program


def main() -> int:
    """Runs the command line of this process, and returns the exit code."""
    called = sys.argv[0] if os.path.basename(sys.argv[0]).startswith("nirspi") else "nirspi"
    return program([called, *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
