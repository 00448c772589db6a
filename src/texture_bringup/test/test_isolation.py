# SPDX-License-Identifier: Apache-2.0
import socket

import pytest

from texture_bringup.demo import FIRST_PORT, FIRST_UNICAST, PORTS_PER_DOMAIN, isolate

pytestmark = pytest.mark.ros


def test_a_domain_in_use_is_left_alone(tmp_path) -> None:
    first = isolate(tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('', FIRST_PORT + PORTS_PER_DOMAIN * first.domain_id + FIRST_UNICAST))
        assert isolate(tmp_path).domain_id != first.domain_id
