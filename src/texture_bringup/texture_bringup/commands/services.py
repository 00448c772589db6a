# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that send one request without values, an `std_srvs/Trigger`, and print the answer.

The manifest lists them, and the entry point of each is the object of its name.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

EXPLORER_MISSING = 'start an explorer, such as the emulator with `texture launch emulator`, or give its --namespace'
TOUCHES_MISSING = "the launch files 'ur' and 'ros_controllers' offer it; start one of them, or give its --namespace"


@dataclass(frozen=True)
class ServiceCommand:
    """A sub-command that calls a service.

    Attributes
    ----------
    service
        Name of the service.
    summary
        What it does, for the help.
    advice
        What to do when no node offers it.
    """

    service: str
    summary: str
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
        from texture_bringup.operator import Operator  # noqa: PLC0415  # the help reads this module without ROS

        with Operator(options.namespace) as operator:
            success, message = operator.call(self.service, self.advice)
        print(message)
        return 0 if success else 1


stop = ServiceCommand(
    'stop',
    'end the exploration and lift the finger, from any phase',
    'no explorer runs there; if the robot moves, use its own stop, and look whether the finger touches',
)
recover = ServiceCommand('recover', 'free the arm from a fault')
lift = ServiceCommand('lift', 'lift a finger that was left pressed on the surface')
reboot = ServiceCommand(
    'reboot',
    'reboot the motors of a hand',
    "only the launch file 'hand' offers it; start that, or give its --namespace",
)
touch_surface = ServiceCommand('touch_surface', 'take one of the touches that find the surface', TOUCHES_MISSING)
forget_touches = ServiceCommand('forget_touches', 'begin the touches that find the surface again', TOUCHES_MISSING)
tare = ServiceCommand(
    'tare',
    'tare a sensor that nothing touches',
    'start a sensor, such as the emulated one with `texture launch emulator`, or give its --namespace',
)
