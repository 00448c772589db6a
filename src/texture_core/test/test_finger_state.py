from __future__ import annotations

import socket

import pytest

from texture_core.types import LOOPBACK, FingerSender, FingerState


def test_a_state_survives_the_wire() -> None:
    state = FingerState(123_456_789_012, 0.1, -0.2, 0.003, 0.05, 0.0, -0.01, 1.5)
    assert FingerState.from_bytes(state.to_bytes()) == state


@pytest.mark.parametrize('data', [b'', b'TTF1', b'X' * 68, FingerState(1).to_bytes() + b'\0'])
def test_a_foreign_datagram_is_no_state(data: bytes) -> None:
    assert FingerState.from_bytes(data) is None


def test_the_bench_is_reported_if_it_has_a_port_and_need_not_listen() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as emulator:
        emulator.bind((LOOPBACK, 0))
        emulator.settimeout(10.0)
        sender, silent = FingerSender(emulator.getsockname()[1]), FingerSender(0)
        for _ in range(2):
            silent.send(FingerState(0))
            sender.send(FingerState(7))
            assert FingerState.from_bytes(emulator.recv(256)) == FingerState(7)
            sender.close()
    sender.send(FingerState(8))
    sender.close()
