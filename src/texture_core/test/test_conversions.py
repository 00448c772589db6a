# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every data class goes through its message, serialised as on the wire, and comes back the same."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from texture_msgs import msg

from texture_core.errors import ExplorationError, InvalidData
from texture_core.ros import frame_name, from_msg, to_msg
from texture_core.types import (
    ExplorationRequest,
    ExplorationState,
    FeatureVector,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)

pytestmark = pytest.mark.ros
STAMP = 1_700_000_000_123_456_789
EXAMPLES = [
    TactileSignal(
        STAMP,
        'a/b',
        ('x', 'y'),
        ('Pa', 'N'),
        2200.0,
        2**40,
        np.array([[1.5, math.nan], [-3e-20, 7]], np.float32),
        'tip',
        tared=True,
    ),
    ExplorationState(
        STAMP,
        'e-1',
        'linear_slide',
        Phase.SLIDE,
        0.1,
        0.05,
        1.0,
        math.pi / 4,
        0.5,
        'felt',
        0.1,
        -0.2,
        3e-3,
        'surface',
        0.6,
    ),
    FeatureVector(STAMP, 'e-1', 0.5, 0.1, ('a', 'b'), np.array([0.1, math.nan]), 0.05, 1.0, 'f', False, 3, 12, 'tip'),
    FeatureVector(STAMP, 'e-1', 0.0, 0.1, last=True),
    TextureEstimate(
        STAMP,
        'e-1',
        'felt',
        Rejection.AMBIGUOUS,
        0.9,
        (0.9, 0.1),
        True,
        ('felt',),
        4,
        0.8,
        True,
        1e-4,
        'm',
        'ok',
        'tip',
        7,
    ),
    ModelInfo(STAMP, 'm', 7, ('felt', 'wool'), 'f'),
    ExplorationRequest('linear_slide', 0.05, 1.0, duration_s=2.5, surface='felt', early_stopping=True, timeout_s=30.25),
    RoughnessEstimate(STAMP, 'e-1', True, 3.5, 0.4, 4, 0.8, True, 1e-4, 'm', 'ok', 'tip'),
]


@pytest.mark.parametrize('value', EXAMPLES, ids=lambda value: type(value).__name__)
def test_a_value_survives_the_wire(value: object) -> None:
    message = to_msg(value)
    back = from_msg(deserialize_message(serialize_message(message), type(message)))
    for item in fields(value):  # type: ignore[arg-type]
        np.testing.assert_equal(getattr(back, item.name), getattr(value, item.name))


@pytest.mark.parametrize('seconds', [math.nan, math.inf, 1e10])
def test_a_time_that_no_message_holds_is_refused(seconds: float) -> None:
    with pytest.raises(InvalidData, match=r'a time is .* s; less than'):
        to_msg(ExplorationRequest('in_hand_sliding', duration_s=seconds))


def test_samples_that_do_not_fill_the_channels_are_refused() -> None:
    message = msg.TactileSignal(sensor='s', channels=['x', 'y'], sampling_rate_hz=1.0, samples=[1.0, 2.0, 3.0])
    with pytest.raises(InvalidData, match='3 samples for 2 channels'):
        from_msg(message)


def test_an_unknown_phase_is_refused() -> None:
    with pytest.raises(InvalidData, match=r'phase 99; allowed are 0 \(idle\), .*6 \(aborted\)'):
        from_msg(msg.ExplorationState(phase=99))


def test_an_unknown_rejection_is_refused() -> None:
    with pytest.raises(InvalidData, match=r'rejection 9; allowed are 0 \(none\), .*5 \(no_model\)'):
        from_msg(msg.TextureEstimate(rejection=9))


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
