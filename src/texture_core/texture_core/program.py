"""How a program of the suite ends: exit codes, and one sentence for an error of the user."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

from texture_core.errors import TextureError

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
