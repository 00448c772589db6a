# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every data class goes through its message, serialised as on the wire, and comes back the same."""

from __future__ import annotations

import math
from dataclasses import fields, make_dataclass
from typing import Any, get_type_hints

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from texture_msgs import msg

from texture_core.errors import ExplorationError, InvalidData
from texture_core.ros import CODEC, frame_name, from_msg, to_msg
from texture_core.types import DATA_CLASSES, Array, ExplorationRequest, ExplorationState, Phase, Rejection

pytestmark = pytest.mark.ros
STAMP = 1_700_000_000_123_456_789
# A value of each type that is no default.
VALUES = {
    int: 2**40,
    float: 30.25,
    str: 'felt',
    bool: True,
    tuple[str, ...]: ('felt', 'wool'),
    tuple[float, ...]: (0.9, 0.1),
    Array: np.array([0.1, math.nan]),
    NDArray[np.float32]: np.array([[1.5, math.nan], [-3e-20, 7]], np.float32),
    Phase: Phase.SLIDE,
    Rejection: Rejection.AMBIGUOUS,
}
OTHERS = {
    'stamp_ns': STAMP,
    'start_ns': STAMP,
    'windows': 4,
    'skipped': 3,
    'revision': 7,
    'sequence': 12,
    'error_code': 21,
}


def example(cls: type) -> Any:
    """Return an object without any default value."""
    return cls(**{name: OTHERS.get(name, VALUES[kind]) for name, kind in get_type_hints(cls).items()})


@pytest.mark.parametrize('cls', DATA_CLASSES)
def test_a_value_survives_the_wire(cls: type) -> None:
    value = example(cls)
    message = to_msg(value)
    back = from_msg(deserialize_message(serialize_message(message), type(message)))
    for item in fields(value):  # type: ignore[arg-type]
        np.testing.assert_equal(getattr(back, item.name), getattr(value, item.name))


def test_a_message_that_lacks_a_field_of_its_data_class_is_older_than_the_code() -> None:
    newer = make_dataclass('ExplorationRequest', [('bend_rad', float, 0.0)], bases=(ExplorationRequest,), frozen=True)
    sentence = 'ExplorationRequest has no bend_rad: the messages are older than the code; run `make setup`'
    with pytest.raises(InvalidData, match=sentence):
        to_msg(newer('linear_slide'))
    with pytest.raises(InvalidData, match=sentence):
        CODEC.from_message(msg.ExplorationRequest(motion='linear_slide'), newer)


@pytest.mark.parametrize('seconds', [math.nan, math.inf, 1e10])
def test_a_time_that_no_message_holds_is_refused(seconds: float) -> None:
    with pytest.raises(InvalidData, match=r'a time is .* s; less than'):
        to_msg(ExplorationRequest('in_hand_sliding', duration_s=seconds))


@pytest.mark.parametrize(
    ('message', 'sentence'),
    [
        (msg.ExplorationState(phase=99), r'phase 99; allowed are 0 \(idle\), .*6 \(aborted\)'),
        (msg.TextureEstimate(rejection=9), r'rejection 9; allowed are 0 \(none\), .*5 \(no_model\)'),
        (
            msg.TactileSignal(sensor='s', channels=['x', 'y'], sampling_rate_hz=1.0, samples=[1.0, 2.0, 3.0]),
            '3 samples for 2 channels',
        ),
    ],
)
def test_a_message_that_contradicts_itself_is_refused(message: Any, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        from_msg(message)


@pytest.mark.parametrize('phase', Phase)
def test_each_phase_has_the_constant_of_the_message(phase: Phase) -> None:
    message = to_msg(ExplorationState(STAMP, 'e-1', 'linear_slide', phase))
    assert message.phase == getattr(msg.ExplorationState, f'PHASE_{phase.name}')


@pytest.mark.parametrize(
    ('codes', 'message', 'prefix'),
    [
        (ExplorationError, msg.ExplorationResult, 'ERROR_'),
        (Rejection, msg.TextureEstimate, 'REJECTION_'),
    ],
)
def test_the_codes_are_the_constants_of_the_messages(codes, message, prefix) -> None:
    constants = {name: getattr(message, name) for name in dir(message) if name.startswith(prefix) and '__' not in name}
    assert {f'{prefix}{code.name}': code.value for code in codes} == constants


def test_a_result_and_an_estimate_that_nobody_filled_claim_nothing() -> None:
    assert msg.ExplorationResult().error_code == msg.ExplorationResult.ERROR_INTERNAL
    assert msg.TextureEstimate().rejection == msg.TextureEstimate.REJECTION_TOO_LITTLE_EVIDENCE


@pytest.mark.parametrize(
    ('namespace', 'name', 'on_tf'),
    [
        ('/', 'fingertip', 'fingertip'),
        ('//', 'fingertip', 'fingertip'),
        ('/left', 'fingertip', 'left/fingertip'),
        ('/left/', 'fingertip', 'left/fingertip'),
        ('/left/finger0', 'fingertip', 'left/finger0/fingertip'),
        ('/left', 'cell/table', 'cell/table'),
        ('/left', '', ''),
    ],
)
def test_a_frame_carries_the_namespace_unless_it_is_named_in_full(namespace, name, on_tf):
    assert frame_name(namespace, name) == on_tf
