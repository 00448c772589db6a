# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals and slides as standard tools draw them."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import Image
from texture_msgs import msg
from visualization_msgs.msg import Marker

from texture_bringup.nodes.views import Views, curve, taxel_image
from texture_core.ros import SENSOR_QOS, STATE_QOS, to_msg, to_ns
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationState, Phase, TactileSignal

pytestmark = pytest.mark.ros


def batch(values, rate_hz=1000.0, channels=('film',), stamp_ns=10**9):
    samples = np.array(values, np.float32).reshape(-1, len(channels))
    return TactileSignal(stamp_ns, 'finger', tuple(channels), (), rate_hz, 0, samples, 'tip')


def test_a_curve_has_each_sample_at_its_own_time():
    points = list(curve(batch([1.0, 2.0, 3.0], rate_hz=2000.0)))
    assert [time_ns for time_ns, _ in points] == [10**9, 10**9 + 500_000, 10**9 + 1_000_000]
    assert [row.tolist() for _, row in points] == [[1.0], [2.0], [3.0]]


def test_a_signal_too_fast_to_draw_keeps_its_peaks_in_fewer_points():
    sine = np.sin(2 * np.pi * 3000.0 * np.arange(480) / 48_000.0)
    points = list(curve(batch(sine, rate_hz=48_000.0)))
    assert len(points) <= 0.010 * 2500
    values = np.array([row[0] for _, row in points])
    assert (values.max(), values.min()) == (np.float32(sine.max()), np.float32(sine.min()))
    times_ns = [time_ns for time_ns, _ in points]
    assert times_ns == sorted(times_ns)
    assert times_ns[-1] < 10**9 + 10_000_000


def test_a_taxel_stands_in_the_image_where_its_name_says():
    image = taxel_image(batch([5.0, 6.0, 7.0], channels=('taxel_0_1', 'taxel_1_0', 'taxel_2_1')))
    assert image.shape == (3, 2)
    assert (image[0, 1], image[1, 0], image[2, 1], math.isnan(image[0, 0])) == (5.0, 6.0, 7.0, True)


@pytest.mark.realtime
def test_each_view_comes_to_who_looks():
    with LocalGraph(73, deadline_s=60.0) as graph:
        views = graph.add(Views)
        drawn = graph.listen(msg.SignalSample, 'views/signal')
        images = graph.listen(Image, 'views/taxels')
        wrenches = graph.listen(WrenchStamped, 'views/wrench')
        paths = graph.listen(Marker, 'views/path')
        graph.until(lambda: views.count_subscribers('views/path'))
        publish = {
            topic: graph.peer.create_publisher(msg.TactileSignal, topic, SENSOR_QOS)
            for topic in ('signal', 'signal_static', 'signal_wrench')
        }
        states = graph.peer.create_publisher(msg.ExplorationState, 'exploration', STATE_QOS)
        graph.until(lambda: all(one.get_subscription_count() for one in (*publish.values(), states)))
        given = {
            'signal': batch([1.0, 4.0]),
            'signal_static': batch([1.0, 2.0, 3.0, 4.0], channels=('t_0_0', 't_0_1', 't_1_0', 't_1_1')),
            'signal_wrench': batch([1.0, 2.0, 3.0, 40.0, 50.0, 60.0], channels=('fx', 'fy', 'fz', 'tx', 'ty', 'tz')),
        }
        sliding = ExplorationState(
            10**9, 'e', 'linear_slide', Phase.SLIDE, x_m=0.1, y_m=0.2, z_m=0.0, frame_id='surface'
        )

        def all_came():
            for topic, value in given.items():
                publish[topic].publish(to_msg(value))
            states.publish(to_msg(sliding))
            return drawn and images and wrenches and paths

        graph.until(all_came)
        assert [(to_ns(one.header.stamp), list(one.values)) for one in drawn[:2]] == [
            (10**9, [1.0]),
            (10**9 + 10**6, [4.0]),
        ]
        assert np.frombuffer(bytes(images[0].data), np.float32).tolist() == [1.0, 2.0, 3.0, 4.0]
        assert (images[0].height, images[0].width, images[0].encoding, images[0].step) == (2, 2, '32FC1', 8)
        assert (wrenches[0].wrench.force.z, wrenches[0].wrench.torque.x) == (3.0, pytest.approx(0.04))  # N and N m
        assert (paths[0].header.frame_id, paths[0].points[0].y) == ('surface', 0.2)
