"""The command `beamcast`, and `python -m beamcast`."""

import os
import signal
import sys

from . import _native


def main() -> None:
    """Runs the command line on the process's arguments, and ends the process with its exit code."""
    # Python's handler would only take note of Ctrl-C. The command watches signals itself, and until it does, they end the process.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = _native.command(["beamcast", *sys.argv[1:]])
    sys.stdout.flush()
    sys.stderr.flush()
    # Nothing of Python is left to be done, and threads of the command may still wait for signals.
    os._exit(code)


if __name__ == "__main__":
    main()
