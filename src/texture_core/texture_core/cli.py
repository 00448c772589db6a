# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Common parts of the sub-commands of `texture`: exit codes, error messages, options."""

from __future__ import annotations

import argparse
import errno
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NoReturn, TypeVar

from texture_core.config import from_mapping, parameters_of, ros_namespace, unknown_name
from texture_core.errors import InvalidParameter, TextureError

T = TypeVar('T')


@dataclass(frozen=True)
class Command:
    """A sub-command of `texture` in a module with several; package.xml lists it by its name there."""

    summary: str
    configure: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


NUMBERS: Mapping[Any, str] = {int: 'a whole number', float: 'a number'}


class Parser(argparse.ArgumentParser):
    """Raises an error in a sentence that names what came, what is allowed, and the nearest name."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        # Not taken for an option: argparse knows no exponent, inf and nan, of which the range is checked
        self._negative_number_matcher = re.compile(r'-((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf|nan)$', re.IGNORECASE)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the values of all options, and no more words; refuse what is no option."""
        self._words = sys.argv[1:] if args is None else args
        options, more = super().parse_known_args(args, namespace)
        for word in more:
            if word.startswith('-'):
                raise unknown_name(word.partition('=')[0], self._option_string_actions, f'option of {self.prog}')
            raise InvalidParameter(f"'{word}' is one argument too many; {self._usage()}")
        return options, more

    def error(self, message: str) -> NoReturn:
        """Refuse what argparse refuses, such as a missing argument; of an option, only its form is shown."""
        usage = self._usage()
        if required := [one for one in self._actions if one.required]:
            for one in required:  # what is no option is named before what is missing
                one.required = False
            self.parse_known_args(self._words)
        name, _, fault = message.removeprefix('argument ').partition(': ')
        if action := self._option_string_actions.get(name.partition('/')[0]):
            form = self._get_formatter()._format_action_invocation(action)
            raise InvalidParameter(f'{name} {fault}; write {form}')
        raise InvalidParameter(f'{message.removeprefix("argument ")}; {usage}')

    def _usage(self) -> str:
        return f'write {" ".join(self.format_usage().split()[1:])}'

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        try:
            return super()._get_value(action, arg_string)
        except argparse.ArgumentError as error:
            name, needed = '/'.join(action.option_strings) or action.dest, NUMBERS.get(action.type)
            # A function such as `core_count` has a sentence for what it refuses
            fault = f'{needed} is needed: {(action.help or "") % vars(action)}' if needed else error.message
            raise InvalidParameter(f"{name} is '{arg_string}'; {fault}") from None

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            name = '/'.join(action.option_strings) or action.dest
            raise unknown_name(str(value), map(str, action.choices), f'value of {name}')


# --------------------
# Options of several sub-commands.


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Add `--namespace`."""
    parser.add_argument('--namespace', default='', type=ros_namespace, metavar='NS', help='namespace of the nodes')


def add_bag_namespace(parser: argparse.ArgumentParser) -> None:
    """Add `--namespace` of what is read from bags."""
    about = 'of the finger, if bags hold several'
    parser.add_argument('--namespace', default=None, type=ros_namespace, metavar='NS', help=about)


class _NotEmpty(argparse.Action):
    """Take a text that is given, and refuse an empty one, as of a variable of the shell that is not set."""

    def __call__(self, parser: object, namespace: object, values: Any, option_string: str | None = None) -> None:
        if not values.strip():
            raise InvalidParameter(f"{option_string} is '{values}'; write {self.metavar}, or leave it out for all")
        setattr(namespace, self.dest, values)


def add_slides(parser: argparse.ArgumentParser) -> None:
    """Add `--slides`."""
    parser.add_argument(
        '--slides',
        action=_NotEmpty,
        default='',
        metavar='N-M',
        help='which slides of each surface, counted as recorded, such as 1-30 or 1,3,5-7; all if not given',
    )


def add_dask(parser: argparse.ArgumentParser) -> None:
    """Add `--dask`."""
    parser.add_argument('--dask', default='', metavar='ADDRESS', help='scheduler of a Dask cluster to use instead')


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add `--seed`."""
    parser.add_argument('--seed', type=int, default=0, help='random seed')


def core_count(text: str) -> int:
    """Return a number of cores, negative to leave some of all free as joblib does; argparse reports what it raises."""
    if not (count := int(text)):
        raise argparse.ArgumentTypeError('0 cores compute nothing; 1 or more are needed, or -1 for all')
    return count


METAVARS = {int: 'N', float: 'NUMBER', str: 'TEXT'}


def add_parameters(parser: argparse.ArgumentParser, cls: type, without: Sequence[str] = ()) -> None:
    """Add an option for each parameter of a dataclass but some: `--low-hz` for `low_hz`."""
    for one in parameters_of(cls):
        if one.name in without:
            continue
        about = one.description.rstrip('.').replace('%', '%%') + (f', {one.unit}' if one.unit else '')
        shape = {'choices': one.choices} if one.choices else {'metavar': one.unit.upper() or METAVARS[one.type]}
        option = f'--{one.name.replace("_", "-")}'
        parser.add_argument(option, type=one.type, default=one.default, help=f'{about} (default: %(default)s)', **shape)


def parameters_from(options: argparse.Namespace, cls: type[T], more: Mapping[str, object] = MappingProxyType({})) -> T:
    """Return the dataclass with the values of the options of `add_parameters` and of `more`, within its ranges."""
    named = {one.name: getattr(options, one.name) for one in parameters_of(cls) if hasattr(options, one.name)}
    return from_mapping(cls, {**named, **more})


# --------------------
# Progress of a long task. Libraries report it; a program shows it after `show_progress()`.

QUIET_S = 3.0  # a shorter task shows no progress
TERMINAL_PERIOD_S, LOG_PERIOD_S = 0.5, 10.0


class _Shown:
    """Whether progress is shown, and whether an outer task shows it at present."""

    wanted = False
    busy = False


def show_progress() -> None:
    """Show the progress of this process from now on, on the error stream."""
    _Shown.wanted = True


@contextmanager
def task(what: str, total: int = 0, quiet_s: float | None = None) -> Iterator[Callable[[], None]]:
    """Show name, progress and duration of a `with` block that takes longer than `quiet_s` (3 s).

    On a terminal one line changes in place and goes at the end; elsewhere a line is written every 10 s. Of nested tasks
    the outermost is shown.
    """
    if not _Shown.wanted or _Shown.busy:
        yield lambda: None
        return
    quiet_s = QUIET_S if quiet_s is None else quiet_s
    _Shown.busy = True
    began_s, done, over = time.monotonic(), 0, threading.Event()
    terminal = sys.stderr.isatty()

    def step() -> None:
        nonlocal done
        done += 1

    def report() -> None:
        waited_s = quiet_s
        while not over.wait(waited_s):
            waited_s = TERMINAL_PERIOD_S if terminal else LOG_PERIOD_S
            count = f' {done} of {total}' if total else f' {done}' if done else ''
            since = f'{count}, {time.monotonic() - began_s:.0f} s'
            if terminal:  # a line that wraps could not be written over
                room = max(0, shutil.get_terminal_size().columns - 1 - len(since))
                print(f'\r\x1b[2K{what[:room]}{since}', end='', file=sys.stderr, flush=True)
            else:
                print(f'{what}{since}', file=sys.stderr, flush=True)

    reporter = threading.Thread(target=report, name='progress', daemon=True)
    reporter.start()
    try:
        yield step
    finally:
        over.set()
        reporter.join()
        _Shown.busy = False
        if terminal and time.monotonic() - began_s > quiet_s:
            print('\r\x1b[2K', end='', file=sys.stderr, flush=True)


def progress(items: Iterable[T], what: str, total: int = 0) -> Iterator[T]:
    """Yield items as a `task` of as many steps."""
    with task(what, total) as step:
        for item in items:
            yield item
            step()


# --------------------
# End of a program of the suite: exit codes, and one sentence for an error of the user.

USER_ERROR, INTERRUPTED, CUT_OFF = 2, 130, 141
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def run_program(action: Callable[[], int], name: str = 'texture') -> int:
    """Run the action of a program, and return its exit code."""
    try:
        try:
            return action()
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
        return CUT_OFF
    except TextureError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return USER_ERROR
    except OSError as error:
        if error.filename is None and error.errno in NO_ROOM:
            _discard_output()
            sentence = f'the output cannot be written: {error.strerror}; make room, or write it elsewhere'
            print(f'{name}: {sentence}', file=sys.stderr)
            return USER_ERROR
        if error.filename is None:  # no file: a fault of the program, whose traceback is needed
            raise
        print(f"{name}: '{error.filename}' cannot be used: {error.strerror}; give another path", file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt as interrupt:
        print('; '.join(filter(None, (f'{name}: interrupted', str(interrupt)))), file=sys.stderr)
        return INTERRUPTED


def _discard_output() -> None:
    """Discard the remaining output; otherwise Python reports an error at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
