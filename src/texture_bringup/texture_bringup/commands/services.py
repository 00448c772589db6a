# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that call one service of a running node and print the answer."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from texture_bringup.launcher import given_arguments
from texture_bringup.operator import Operator
from texture_core.cli import Command, add_namespace
from texture_core.errors import InvalidParameter, counted

# --------------------
# Services without values, each an `std_srvs/Trigger`.

STOP = 'explorer/stop'  # whose answer is not waited for as long
EXPLORER_MISSING = 'start an explorer, such as the emulator with `texture launch emulator`, or give its --namespace'
TOUCHES_MISSING = "the launch files 'ur' and 'ros_controllers' offer it; start one of them, or give its --namespace"


def trigger(summary: str, service: str, advice: str = EXPLORER_MISSING) -> Command:
    """Return the sub-command that calls a service; `advice` is the remedy when no node offers it."""

    def run(options: argparse.Namespace) -> int:
        with Operator(options.namespace) as operator:
            success, message = operator.stop() if service == STOP else operator.call(service, advice)
        print(message)
        return 0 if success else 1

    return Command(summary, add_namespace, run)


stop = trigger('end the exploration and lift the finger, from any phase', STOP)
recover = trigger('free the arm from a fault', 'explorer/recover')
lift = trigger('lift a finger that was left pressed on the surface', 'explorer/lift')
touch_surface = trigger('take one touch of the surface calibration', 'explorer/touch_surface', TOUCHES_MISSING)
forget_touches = trigger('restart the touches of the surface calibration', 'explorer/forget_touches', TOUCHES_MISSING)
tare = trigger(
    'tare a sensor that nothing touches',
    'sensor/tare',
    "start a driver of this suite, or give its --namespace; tare a mapped sensor by its vendor's driver",
)

# --------------------
# Textures that are added to and removed from a running classifier.


def _configure_add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('label', nargs='?', default='', help='label of the texture; a new label adds a class')
    parser.add_argument(
        'exploration', nargs='?', default='', help='id of the exploration to add; default: the last one'
    )
    parser.add_argument('--undo', action='store_true', help='remove the slide that was added last')
    add_namespace(parser)


def _add(options: argparse.Namespace) -> int:
    if options.undo == bool(options.label):
        raise InvalidParameter('give the label of the texture to add, or --undo alone')
    with Operator(options.namespace) as operator:
        if options.undo:
            print(operator.remove_last_added())
            return 0
        examples, message = operator.add(options.label, options.exploration)
    print(f"{message}; '{options.label.strip()}' has {counted(examples, 'window')} now")
    return 0


def _configure_remove(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('label', help='label of the texture; one of the training stays as it was trained')
    add_namespace(parser)


def _remove(options: argparse.Namespace) -> int:
    with Operator(options.namespace) as operator:
        print(operator.remove(options.label))
    return 0


add = Command('add the slide that was explored last to a texture; or undo it', _configure_add, _add)
remove = Command('remove a texture that was added since the training', _configure_remove, _remove)

# --------------------
# Lifecycle nodes: the sensor, and the explorer with its arm.


def _activating(active: bool) -> tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]:
    """Return what `activate` or `deactivate` is configured by, and what it does."""
    # The arm is released first and activated last.
    usual = ['sensor', 'explorer'] if active else ['explorer', 'sensor']

    def configure(parser: argparse.ArgumentParser) -> None:
        parser.add_argument('nodes', nargs='*', metavar='NODE', help=f'in this order; default: {" ".join(usual)}')
        add_namespace(parser)

    def run(options: argparse.Namespace) -> int:
        with Operator(options.namespace) as operator:
            for node in options.nodes or usual:
                print(f'{node}: {operator.set_active(node, active)}')
        return 0

    return configure, run


activate = Command('configure and activate nodes: sensor and arm begin to work', *_activating(True))
deactivate = Command('deactivate nodes: sensor and arm are released, the nodes stay', *_activating(False))

# --------------------
# Parameters.


def _configure_set(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('node', help='name of the node, such as emulator')
    parser.add_argument('values', nargs='+', metavar='NAME:=VALUE', help='parameters and their values')
    add_namespace(parser)


def _set(options: argparse.Namespace) -> int:
    values = given_arguments(options.values)
    with Operator(options.namespace) as operator:
        operator.set_parameters(options.node, values)
    print(f'{options.node}: ' + ', '.join(f'{name} is {text}' for name, text in values.items()))
    return 0


set_ = Command('set parameters of a running node, such as the surface of the emulator', _configure_set, _set)
