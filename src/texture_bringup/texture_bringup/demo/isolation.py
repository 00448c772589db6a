"""Places of its own for a demonstration, so that it disturbs nothing that runs already."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from texture_core.errors import LaunchFailed

# Domains whose ports lie below the ephemeral ports of Linux:
# https://docs.ros.org/en/jazzy/Concepts/Intermediate/About-Domain-ID.html The tests of the suite have those above 60.
DOMAINS = range(1, 61)
# Ports of the first participant of domain d (DDSI-RTPS 2.2, 9.6.1.1): 7400 + 250·d + 10 and + 11.
FIRST_PORT, PORTS_PER_DOMAIN, FIRST_UNICAST = 7400, 250, 10


@dataclass(frozen=True)
class Isolation:
    """A ROS domain, a UDP port for the finger and a path for the device that nobody else uses."""

    domain_id: int
    finger_port: int
    device: Path

    def environment(self, base: Mapping[str, str]) -> dict[str, str]:
        """Return the environment for processes in this isolation."""
        return {**base, 'ROS_DOMAIN_ID': str(self.domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def isolate(folder: Path) -> Isolation:
    """Return places that are free now; the device will appear in `folder`.

    Raises
    ------
    LaunchFailed
        If every domain is in use.
    """
    # Programs that start at the same moment look at different domains first.
    first = os.getpid() % len(DOMAINS)
    for domain_id in (*DOMAINS[first:], *DOMAINS[:first]):
        if all(_is_free(FIRST_PORT + PORTS_PER_DOMAIN * domain_id + FIRST_UNICAST + offset) for offset in (0, 1)):
            return Isolation(domain_id, free_port(), folder / 'tsf85')
    raise LaunchFailed(f'every ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use; stop something first')


def free_port() -> int:
    """Return a UDP port on loopback that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True
