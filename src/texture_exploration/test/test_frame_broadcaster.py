# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frames of surface and fingertip, as a listener on tf gets them."""

import math
from types import SimpleNamespace

import pytest
from rclpy.clock import Clock

from texture_core.errors import InvalidParameter
from texture_core.types import ExplorationState, Phase, quaternion_matrix, rotation_matrix
from texture_exploration.arms.arm import SurfaceFrame
from texture_exploration.nodes import explorer as frame_broadcaster
from texture_exploration.nodes.explorer import FrameBroadcaster, FrameParams

pytestmark = pytest.mark.ros

POSE = (0.4, -0.1, 0.02, 0.2, -0.1, 0.5)


class Owner:
    """A node in the namespace 'left' that keeps what it publishes."""

    def __init__(self):
        self.published, self.logged = {}, []

    def get_namespace(self):
        return '/left'

    def get_clock(self):
        return Clock()

    def get_logger(self):
        return SimpleNamespace(info=self.logged.append)

    def create_publisher(self, _kind, topic, _qos):
        messages = self.published.setdefault(topic, [])
        return type('Publisher', (), {'publish': lambda _self, message: messages.append(message)})()


def state(**place):
    return ExplorationState(5, 'one', 'linear_slide', Phase.SLIDE, **place)


def test_the_surface_is_where_the_arm_believes_it_in_its_base_frame():
    pytest.importorskip('tf2_msgs')
    owner = Owner()
    FrameBroadcaster(owner, FrameParams()).surface('base', POSE)
    [[transform]] = [message.transforms for message in owner.published['/tf_static']]
    assert (transform.header.frame_id, transform.child_frame_id) == ('base', 'left/surface')
    shift, turned = transform.transform.translation, transform.transform.rotation
    matrix = quaternion_matrix((turned.x, turned.y, turned.z, turned.w))
    assert matrix == pytest.approx(rotation_matrix(POSE[3:]))
    here = (0.01, 0.02, 0.03)
    in_base = matrix @ here + (shift.x, shift.y, shift.z)
    assert in_base == pytest.approx(SurfaceFrame(POSE).place_to_base(here))
    assert '/tf' not in owner.published


def test_the_fingertip_is_broadcast_if_wanted_and_known():
    pytest.importorskip('tf2_msgs')
    owner = Owner()
    frames = FrameBroadcaster(owner, FrameParams(broadcast_surface=False, broadcast_fingertip=True))
    frames.surface('base', POSE)
    frames.fingertip(state(x_m=math.nan))
    frames.fingertip(state(x_m=0.01, y_m=0.02, z_m=0.003))
    [message] = owner.published['/tf']
    [transform] = message.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ('left/surface', 'left/fingertip')
    shift = transform.transform.translation
    assert (shift.x, shift.y, shift.z) == (0.01, 0.02, 0.003)
    assert transform.header.stamp.nanosec == 5
    assert '/tf_static' not in owner.published


def test_without_tf2_messages_only_a_fingertip_that_is_asked_for_is_refused(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(frame_broadcaster.importlib, 'import_module', missing)
    owner = Owner()
    frames = FrameBroadcaster(owner, FrameParams())
    frames.surface('base', POSE)
    frames.fingertip(state(x_m=0.0))
    assert (owner.published, frames.surface_frame_id) == ({}, 'left/surface')
    assert owner.logged == ['no frame is published on tf, as tf2_msgs is not installed']
    with pytest.raises(InvalidParameter, match='needs tf2_msgs'):
        FrameBroadcaster(owner, FrameParams(broadcast_fingertip=True))
