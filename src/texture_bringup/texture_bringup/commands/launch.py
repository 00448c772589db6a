# SPDX-License-Identifier: Apache-2.0
"""`texture launch`: start the nodes of a launch file."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path

from texture_bringup import launcher
from texture_bringup.launcher import Supervisor, all_arguments, find_launch_file, given_arguments, read
from texture_core.cli import run_program


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the sub-command."""
    parser.add_argument('file', help="path of a launch file, or the name of one of the suite's, such as emulator")
    parser.add_argument('arguments', nargs='*', default=[], metavar='NAME:=VALUE', help='arguments of the launch file')
    parser.add_argument('--parent', type=int, help=argparse.SUPPRESS)
    parser.add_argument(
        '--together',
        action='store_true',
        help='stop all nodes when one dies; otherwise it is started again if it may be',
    )
    parser.add_argument('--show-args', action='store_true', help='show the arguments of the launch file')


def run(options: argparse.Namespace) -> int:
    """Run the nodes until they end or Ctrl-C; return 1 if one died, else 0."""
    if options.parent is not None:
        launcher.end_with(options.parent, signal.SIGINT)
    path = find_launch_file(options.file)
    if options.show_args:
        print(arguments_text(path))
        return 0
    nodes = read(path, given_arguments(options.arguments), os.environ)
    return Supervisor(nodes, _say, together=options.together).run()


def arguments_text(path: Path) -> str:
    """Return the arguments of a launch file and of those it includes with their defaults, one a line."""
    items = all_arguments(path, os.environ)
    defaults = {item.name: f'{item.name}:={"(required)" if item.default is None else item.default}' for item in items}
    width = max(map(len, defaults.values()), default=0)
    return '\n'.join(f'{defaults[item.name]:<{width}}  {item.description}'.rstrip() for item in items)


def _say(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:
        # Who read along has gone: nothing more can be shown, and the nodes are stopped in good order.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        os.kill(os.getpid(), signal.SIGTERM)


# --------------------
# `python -m texture_bringup.commands.launch FILE …`: the launcher by itself, without the `texture` command.


def main() -> int:
    """Start the nodes of a launch file; return the exit code."""
    # Also where a shell has started the program in the background and told it to ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    parser = argparse.ArgumentParser(prog='python -m texture_bringup.commands.launch', description=__doc__)
    configure(parser)
    return run_program(lambda: run(parser.parse_args()))


if __name__ == '__main__':
    sys.exit(main())
