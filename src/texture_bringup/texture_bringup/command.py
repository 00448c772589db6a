"""The `texture` command: everything a user does with the suite, one sub-command each."""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, cast

from texture_core.catalogue import find
from texture_core.errors import TextureError

USER_ERROR, INTERRUPTED, CUT_OFF = 2, 130, 141


class Module(Protocol):
    """What a module of a sub-command holds."""

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Add the arguments of the sub-command."""

    def run(self, options: argparse.Namespace) -> int:
        """Do it, and return the exit code."""


@dataclass(frozen=True)
class Command:
    """A sub-command: its module, imported when it is called, and its line in the help."""

    module: str
    summary: str


COMMANDS: Mapping[str, Command] = {
    'demo': Command(
        'texture_bringup.commands.demo', 'the whole thing on an emulated bench: explore, learn, recognise, report'
    ),
    'launch': Command('texture_launch.commands.launch', 'start the nodes of a launch file'),
    'explore': Command('texture_bringup.commands.explore', 'slide the finger over the surface and say what it is'),
    'identify': Command(
        'texture_bringup.commands.identify',
        'slide as tells most, again and again, until it is sure what the surface is',
    ),
    'dashboard': Command(
        'texture_bringup.commands.dashboard', 'show a web page of what is felt, with buttons to explore and stop'
    ),
    'learn': Command(
        'texture_bringup.commands.learn', 'teach what was explored last as a texture, at once; or undo it'
    ),
    'record': Command('texture_recordings.commands.record', 'record the running system into a bag'),
    'replay': Command('texture_recordings.commands.replay', 'play a bag to the running system'),
    'import': Command('texture_recordings.commands.import_', "turn other people's recordings into labelled bags"),
    'segment': Command('texture_recordings.commands.segment', 'find the slides in bags that do not tell them'),
    'train': Command('texture_evaluation.commands.train', 'learn a model from labelled bags'),
    'optimise': Command('texture_evaluation.commands.optimise', 'tune a recipe on labelled bags by a genetic search'),
    'evaluate': Command('texture_evaluation.commands.evaluate', 'say how good a model is on labelled bags'),
    'scene': Command(
        'texture_bringup.commands.scene', 'draw a simulated surface, the way over it, the signal and its spectrum'
    ),
    'panel': Command(
        'texture_evaluation.commands.panel', 'say what a panel of people grades as rough, and how far they agree'
    ),
    'experiment': Command(
        'texture_benchmarks.commands.experiment', "rebuild a paper's experiment: its figures beside ours"
    ),
    'endurance': Command(
        'texture_benchmarks.commands.endurance', 'explore on the emulated bench for hours while faults strike at random'
    ),
    'bench': Command('texture_benchmarks.commands.bench', 'run a benchmark; writes figures and a chart'),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the `texture` command; return its exit code.

    0, 2 for an error of the user, 130 after Ctrl-C, 141 when nobody reads on what it prints, as behind `| head`.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            return _dispatch(given)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # What is left to print goes nowhere, or Python would complain at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CUT_OFF
    except TextureError as error:
        print(f'texture: {error}', file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        print('texture: interrupted', file=sys.stderr)
        return INTERRUPTED


def _dispatch(given: Sequence[str]) -> int:
    if not given or given[0] in ('-h', '--help', 'help'):
        print(overview())
        return 0
    name, *rest = given
    command = find(COMMANDS, name, 'sub-command of texture')
    module = cast(Module, importlib.import_module(command.module))
    parser = argparse.ArgumentParser(prog=f'texture {name}', description=command.summary)
    module.configure(parser)
    return module.run(parser.parse_args(rest))


def overview() -> str:
    """Return the help of the command itself."""
    lines = [f'  {name:<12}{command.summary}' for name, command in COMMANDS.items()]
    head = 'usage: texture COMMAND [...]\n\nRecognise surfaces by sliding a tactile finger over them.\n'
    return '\n'.join([head, *lines, '\nMore of each: texture COMMAND --help'])


if __name__ == '__main__':
    # Also where a shell has started the command in the background and told it to ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(main())
