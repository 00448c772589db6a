# SPDX-License-Identifier: Apache-2.0
"""Names of frames on tf."""

import pytest

from texture_core.ros import frame_name

pytestmark = pytest.mark.ros


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
