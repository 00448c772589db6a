# SPDX-License-Identifier: Apache-2.0
"""What every sub-command of `texture` shares: exit codes, sentences for errors, common options."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass

from texture_core.errors import TextureError


@dataclass(frozen=True)
class Command:
    """A sub-command of `texture` that shares its module with others; package.xml lists it by its name there.

    Parameters
    ----------
    summary
        What it does, for the help; a literal text, because the help reads it without importing the module.
    configure
        Adds the arguments of the sub-command to a parser.
    run
        Does it, and returns the exit code.

    Examples
    --------
    >>> Command('say hello', add_namespace, lambda options: print('hello') or 0).run(argparse.Namespace())
    hello
    0
    """

    summary: str
    configure: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


# --------------------
# Options that several sub-commands share.


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Add `--namespace`."""
    parser.add_argument('--namespace', default='', help='namespace of the nodes')


def add_slides(parser: argparse.ArgumentParser) -> None:
    """Add `--slides`."""
    parser.add_argument(
        '--slides',
        default='',
        metavar='N-M',
        help='which slides of each surface, as recorded; all if not given',
    )


def add_channels(parser: argparse.ArgumentParser) -> None:
    """Add `--channels`."""
    parser.add_argument(
        '--channels',
        choices=('fast', 'all'),
        help='fast: the vibration alone; all: the slow channels beside it, too; default: as recorded or trained',
    )


def add_dask(parser: argparse.ArgumentParser) -> None:
    """Add `--dask`."""
    parser.add_argument(
        '--dask', default='', metavar='ADDRESS', help='scheduler of a Dask cluster to use instead, or local:WORKERS'
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add `--seed`."""
    parser.add_argument('--seed', type=int, default=0, help='seed of whatever is random')


# --------------------
# How a program of the suite ends: exit codes, and one sentence for an error of the user.

USER_ERROR, INTERRUPTED, CUT_OFF = 2, 130, 141


def run_program(action: Callable[[], int], name: str = 'texture') -> int:
    """Do what a program is for, and return its exit code.

    Parameters
    ----------
    action
        Returns an exit code.
    name
        Of the program, which stands before its sentences.

    Returns
    -------
    int
        That of the action; 2 for an error of the user, 130 after Ctrl-C, 141 when nobody reads on what the program
        prints, as behind `| head`.
    """
    try:
        try:
            return action()
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # What is left to print goes nowhere, or Python would complain at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CUT_OFF
    except TextureError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        return INTERRUPTED
