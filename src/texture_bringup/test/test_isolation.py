# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import socket

import pytest

from texture_bringup.demo import FIRST_PORT, FIRST_UNICAST, PORTS_PER_DOMAIN, free_domain

pytestmark = pytest.mark.ros


def test_a_domain_in_use_is_left_alone() -> None:
    first = free_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', FIRST_PORT + PORTS_PER_DOMAIN * first + FIRST_UNICAST))
        assert free_domain() != first
