# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The `texture` command: everything a user does with the suite, one sub-command each.

A package brings its sub-commands in its folder `commands`: the shared `setup.py` declares each module as an entry point
of the group `texture.commands`, and each `Command` of a module for which the manifest lists several. Third-party
packages may declare theirs in the same way.
"""

from __future__ import annotations

import os
import signal

if __name__ == '__main__':  # Ctrl-C during the imports below ends it without a traceback
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # the shell script `texture` blocks it until here

import argparse
import ast
import importlib.abc
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points, version
from io import TextIOWrapper
from typing import cast

from texture_core.cli import INTERRUPTED, Command, Parser, run_program, show_progress, task
from texture_core.config import check_middleware, find

GROUP, PACKAGE = 'texture.commands', 'texture_bringup'
# In what order the help shows the commands; those of other packages come last.
HELP: Mapping[str, Sequence[str]] = {
    'Start': ('demo', 'doctor', 'list', 'launch', 'dashboard', 'activate', 'deactivate', 'set'),
    'Explore with the running robot': ('explore', 'watch', 'identify', 'stop', 'lift', 'recover'),
    'Prepare': ('tare', 'touch-surface', 'forget-touches', 'check'),
    'Record': ('collect', 'record', 'replay', 'info', 'import', 'segment', 'export'),
    'Learn': ('train', 'add', 'remove'),
    'Measure': ('evaluate', 'cross-validate', 'panel', 'experiment', 'benchmark', 'endurance'),
}


@cache
def installed() -> Mapping[str, EntryPoint]:
    """Return the sub-commands of all installed packages, by name in the order of the alphabet.

    A name in Python holds no hyphen and is no keyword: `touch_surface` is `touch-surface`, and `import_` is `import`.
    """
    found = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    return {entry.name.rstrip('_').replace('_', '-'): entry for entry in found}


def summary(command: EntryPoint) -> str:
    """Return what a sub-command does: the first line of its module, or the first text of the `Command` in it.

    The module is read and not imported: all of them together import numpy, scikit-learn and matplotlib, which would
    take seconds.
    """
    spec = importlib.util.find_spec(command.module)
    loader = cast(importlib.abc.InspectLoader | None, spec.loader if spec else None)
    source = loader.get_source(command.module) if loader else None
    tree = ast.parse(source or '')
    if not command.attr:
        return (ast.get_docstring(tree) or '').split('\n', 1)[0].partition(': ')[2].removesuffix('.')
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == command.attr:
            return str(ast.literal_eval(cast(ast.Call, node.value).args[0]))
    return ''


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the `texture` command; return its exit code: that of the sub-command or of `run_program`."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if '_ARGCOMPLETE' in os.environ:
        _complete()
    return run_program(partial(_dispatch, given))


class MiddlewareCheck(importlib.abc.MetaPathFinder):
    """Checks the middleware of ROS when a module imports rclpy, so that what needs no ROS runs without it."""

    def find_spec(self, fullname: str, *_: object) -> None:
        """Find nothing; raise InvalidParameter before rclpy if the middleware is not installed."""
        if fullname == 'rclpy':
            check_middleware()


def program() -> int:
    """Run the command as a process, which shuts down in order when it is asked to stop."""
    sys.meta_path.insert(0, MiddlewareCheck())
    for stream in (sys.stdout, sys.stderr):  # an encoding may lack a letter
        cast(TextIOWrapper, stream).reconfigure(errors='backslashreplace')
    # Also where a shell has started the command in the background and made it ignore Ctrl-C.
    stopping = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # closed terminal; ignored under nohup
        stopping.append(signal.SIGHUP)
    for number in stopping:
        signal.signal(number, _end)
    try:
        return main()
    finally:
        for number in stopping:  # another one ends what libraries do at the end, without a traceback
            signal.signal(number, lambda *_: os._exit(INTERRUPTED))


def _end(*_: object) -> None:
    """End at a signal; a library that is loading would report an interrupt as an error of its own, or hide it."""
    line = '\r\x1b[2K' if os.isatty(2) else ''  # of the progress
    os.write(2, f'{line}texture: interrupted; nothing was requested\n'.encode())
    os._exit(INTERRUPTED)


def _dispatch(given: Sequence[str]) -> int:
    if not given or given[0] in ('-h', '--help', 'help'):
        print(overview())
        return 0
    if given[0] == '--version':
        print(f'texture {version(PACKAGE)}')
        return 0
    name, *rest = given
    command = find(installed(), name, 'sub-command of texture')
    show_progress()
    with task(f'loading the libraries of {name}'):
        module = cast(Command, command.load())
        parser = Parser(prog=f'texture {name}', description=summary(command))
        module.configure(parser)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is _end:
            signal.signal(number, signal.default_int_handler)
    return module.run(parser.parse_args(rest))


def _complete() -> None:
    """Complete a word for the shell; only the sub-command that it names is imported."""
    import argcomplete  # noqa: PLC0415 - only a shell needs it

    parser = argparse.ArgumentParser(prog='texture')
    parsers = parser.add_subparsers()
    words = os.environ.get('COMP_LINE', '').split()
    for name, command in installed().items():
        chosen = parsers.add_parser(name)
        if name in words[1:2]:
            cast(Command, command.load()).configure(chosen)
    argcomplete.autocomplete(parser)


def overview() -> str:
    """Return the help of the command itself."""
    known = installed()
    others = [name for name in known if not any(name in names for names in HELP.values())]
    lines = ['usage: texture COMMAND [...]', '', 'Recognise surfaces by sliding a tactile finger over them.']
    for title, names in {**HELP, 'Further': others}.items():
        rows = [f'  {name:<16}{summary(known[name])}' for name in names if name in known]
        lines += ['', f'{title}:', *rows] if rows else []
    more = 'More of each: texture COMMAND --help. Completion in bash: eval "$(register-python-argcomplete texture)"'
    return '\n'.join([*lines, '', more])


if __name__ == '__main__':
    sys.exit(program())
