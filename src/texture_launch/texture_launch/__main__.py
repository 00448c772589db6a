"""`python -m texture_launch FILE …`: the launcher by itself, without the `texture` command."""

from __future__ import annotations

import argparse
import signal
import sys

from texture_core.program import run_program
from texture_launch.commands import launch


def main() -> int:
    """Start the nodes of a launch file; return the exit code."""
    # Also where a shell has started the program in the background and told it to ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    parser = argparse.ArgumentParser(prog='python -m texture_launch', description=launch.__doc__)
    launch.configure(parser)
    return run_program(lambda: launch.run(parser.parse_args()))


if __name__ == '__main__':
    sys.exit(main())
