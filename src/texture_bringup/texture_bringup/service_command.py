"""The sub-commands of `texture` that send one request without values, an `std_srvs/Trigger`, and print the answer."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass

from texture_bringup.operator import Operator

EXPLORER_MISSING = 'start an explorer, such as the emulator with `texture launch emulator`, or give its --namespace'
TOUCHES_MISSING = "the launch files 'ur' and 'ros_controllers' offer it; start one of them, or give its --namespace"


@dataclass(frozen=True)
class ServiceCommand:
    """A sub-command that calls a service.

    Attributes
    ----------
    service
        Name of the service.
    advice
        What to do when no node offers it.
    """

    service: str
    advice: str = EXPLORER_MISSING

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Add the arguments of the sub-command."""
        parser.add_argument('--namespace', default='', help='namespace of the nodes')

    def run(self, options: argparse.Namespace) -> int:
        """Call the service and print its answer; return 0 if it succeeded, else 1.

        Raises
        ------
        LaunchFailed
            If no node offers the service, or none answers in time.
        """
        with Operator(options.namespace) as operator:
            success, message = operator.call(self.service, self.advice)
        print(message)
        return 0 if success else 1


SERVICE_COMMANDS: Mapping[str, ServiceCommand] = {
    'stop': ServiceCommand(
        'stop', 'no explorer runs there; if the robot moves, use its own stop, and look whether the finger touches'
    ),
    'recover': ServiceCommand('recover'),
    'lift': ServiceCommand('lift'),
    'reboot': ServiceCommand('reboot', "only the launch file 'hand' offers it; start that, or give its --namespace"),
    'touch-surface': ServiceCommand('touch_surface', TOUCHES_MISSING),
    'forget-touches': ServiceCommand('forget_touches', TOUCHES_MISSING),
    'tare': ServiceCommand(
        'tare', 'start a sensor, such as the emulated one with `texture launch emulator`, or give its --namespace'
    ),
}
