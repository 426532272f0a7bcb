"""The command: ``python -m kfdesign`` is ``kfdesign``."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> int:
    """Run the command line of this process; its exit status."""
    # the command handles its own signals; Python's handler would only note them
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.cli(["kfdesign", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
