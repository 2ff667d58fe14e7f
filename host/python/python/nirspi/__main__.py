"""The program ``nirspi``: the script of this name, and ``python -m nirspi``."""

import os
import signal
import sys

from ._nirspi import program


def main() -> int:
    """Runs the command line of this process, and returns the exit code."""
    # The program has a handler of its own, and Python's would end the process after it.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    called = sys.argv[0] if os.path.basename(sys.argv[0]).startswith("nirspi") else "nirspi"
    return program([called, *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
