from __future__ import annotations

import pytest

from texture_core.finger import FingerState


def test_a_state_survives_the_wire() -> None:
    state = FingerState(123_456_789_012, 0.1, -0.2, 0.003, 0.05, 0.0, -0.01, 1.5)
    assert FingerState.from_bytes(state.to_bytes()) == state


@pytest.mark.parametrize('data', [b'', b'TTF1', b'X' * 68, FingerState(1).to_bytes() + b'\0'])
def test_a_foreign_datagram_is_no_state(data: bytes) -> None:
    assert FingerState.from_bytes(data) is None
