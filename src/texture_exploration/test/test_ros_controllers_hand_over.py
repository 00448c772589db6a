# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What takes the arm behind ROS controllers, and the guard that brings it to rest."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped

from texture_core.errors import DeviceError
from texture_core.ros_testing import LocalGraph, NodeProcess, killed_on_error
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.ros import controllers as controller_topics
from texture_exploration.ros import guard as guard_process
from texture_exploration.ros.controllers import node_of

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

PATIENT = RosControllersParams(connect_timeout_s=30.0, accept_no_timeout=True, accept_shared_group=True)
HELD = {'start_height_m': 0.003, 'command_timeout_s': 0.0}  # as a controller that keeps executing the last velocity
DEADLINE_S = 60.0
MOVING = """
import time
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.ros import controllers

controllers.ALONE_S = 1.0  # there are no other commanders
arm = RosControllersArm(
    RosControllersParams(connect_timeout_s=30.0, deadman_s=1.0, accept_no_timeout=True, accept_shared_group=True)
)
arm.connect()
while True:
    arm.command(ArmCommand(tangential_m_s=(0.01, 0.0)))
    time.sleep(0.01)
"""


@pytest.fixture
def graph():
    with LocalGraph(82, deadline_s=DEADLINE_S) as graph:
        yield graph


TOPICS = ('/twist', 'base', '/pose')
SENDER = '010f5d3b0a7c41e200000000'  # the first 12 bytes of a GUID


def test_a_guard_in_the_namespace_commands_zero_velocity_once_nobody_speaks_for_the_arm(graph):
    twists = graph.listen(TwistStamped, 'twist')
    guard = guard_process.TwistGuard('/left', TOPICS, os.open(os.devnull, os.O_RDONLY))
    try:
        graph.until(lambda: guard.beat(moving=True) or graph.peer.count_publishers('twist'))
        graph.until(lambda: twists)
        info = graph.peer.get_publishers_info_by_topic('twist')[0]
        graph.until(lambda: guard.fault() or guard.participant)
        assert guard_process.sender(info) == guard.participant
        graph.until(lambda: ('arm_guard', '/left') in graph.peer.get_node_names_and_namespaces())
    finally:
        guard.dismiss()
    velocity = twists[0].twist.linear
    assert (twists[0].header.frame_id, velocity.x, velocity.y, velocity.z) == ('base', 0.0, 0.0, 0.0)


class Line:
    """A guard without a process: what it answers is given."""

    def __init__(self, monkeypatch):
        monkeypatch.setattr(guard_process.GuardProcess, '__init__', lambda _self, *_arguments, **_named: None)
        monkeypatch.setattr(guard_process.time, 'monotonic', lambda: self.now_s)
        self.now_s, self.answers = 100.0, []
        self.guard = guard_process.TwistGuard('/', TOPICS, -1)
        self.guard.line, self.guard._process = self, self

    def recv(self, _size):
        if not self.answers:
            raise BlockingIOError
        return self.answers.pop(0)

    def poll(self):
        return None


def test_a_guard_may_be_held_up_for_1_5_s_and_an_answer_that_cannot_be_read_is_no_sign_of_life(monkeypatch):
    line = Line(monkeypatch)
    line.answers += [f'1 {SENDER}'.encode(), b'7413 is taken by another process', b'2', SENDER.encode() + b' 1']
    assert line.guard.fault() == ''
    line.answers += [b'\xff\xfe', b'1 ', b'9' * 4096, f'1 {SENDER} 2'.encode()]
    line.now_s += 1.2
    assert line.guard.fault() == ''
    line.now_s += 0.4
    assert re.search(r'is silent for 1\.6 s; 7 of its answers could not be read', line.guard.fault())
    assert (line.guard.reached, line.guard.participant, line.guard.garbled) == (1, SENDER, 7)


def test_a_guard_whose_explorer_has_ended_commands_zero_until_the_pose_shows_rest():
    rests_after = 60
    ours, line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    zeros, poses = [], []

    def take_pose(rest):
        poses.append(0.001 * min(len(poses), rests_after))
        rest.update(time.monotonic_ns(), (poses[-1], 0.0, 0.0))

    with line:
        ours.send(guard_process.MOVING)
        ours.close()
        guard_process.guarded(line, lambda: zeros.append(len(poses)), take_pose, lambda: None)
    assert len(zeros) >= rests_after
    assert poses[-1] == pytest.approx(0.001 * rests_after)


@pytest.mark.parametrize(('sent', 'zeros_sent'), [(b'm', True), (b'r', False), (b'', False), (b'7', True)])
def test_only_an_arm_reported_at_rest_needs_no_zero_velocity_when_its_heartbeat_is_lost(sent, zeros_sent):
    ours, line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    zeros = []

    def answer():
        if time.monotonic() - begin_s > 0.3:
            ours.send(guard_process.DONE)

    with ours, line:
        if sent:
            ours.send(sent)
        begin_s = time.monotonic()
        guard_process.guarded(line, lambda: zeros.append(1), lambda rest: None, answer)
    assert bool(zeros) is zeros_sent


@pytest.mark.parametrize(('offered', 'started_by'), [(True, guard_process.SCOPE), (False, ())])
def test_the_guard_has_a_control_group_of_its_own_where_systemd_offers_one(tmp_path, monkeypatch, offered, started_by):
    """A stand-in for systemd-run: most containers have none."""
    stand_in = tmp_path / 'systemd-run'
    stand_in.write_text(f'#!/bin/sh\nexit {int(not offered)}\n')
    stand_in.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path))
    guard_process.scope.cache_clear()
    try:
        assert guard_process.scope() == started_by
    finally:
        guard_process.scope.cache_clear()


@pytest.mark.parametrize(
    ('accepted', 'message'),
    [
        ({}, r"'controller_timeout_s'.*'accept_no_timeout: true'"),
        ({'accept_no_timeout': True}, r"leaves the arm moving.*'controller_timeout_s'.*'accept_shared_group: true'"),
    ],
)
def test_a_controller_that_would_go_on_for_ever_is_refused_unless_that_is_accepted(
    graph, monkeypatch, accepted, message
):
    monkeypatch.setattr(controller_topics, 'scope', tuple)
    with pytest.raises(DeviceError, match=message):
        RosControllersArm(RosControllersParams(**accepted)).connect()


def test_an_arm_whose_pose_two_controllers_publish_is_refused(graph):
    places = graph.listen(PoseStamped, 'tcp_pose_broadcaster/pose')
    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        graph.until(lambda: places)
        second = graph.peer.create_publisher(PoseStamped, 'tcp_pose_broadcaster/pose', 1)
        with pytest.raises(
            DeviceError, match=r"controllers publish on 'tcp_pose_broadcaster/pose': .* and .*, such as .*; end it"
        ):
            RosControllersArm(replace(PATIENT, connect_timeout_s=4.0)).connect()
        graph.peer.destroy_publisher(second)


@pytest.mark.parametrize('range_', ['LOCALHOST', 'SUBNET'])
def test_two_announcements_of_conflicts_are_waited_for_before_anything_is_published(graph, monkeypatch, range_):
    monkeypatch.setattr(controller_topics.Node, 'count_subscribers', lambda *_: 1)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', range_)
    monkeypatch.setattr(controller_topics.RosTopics, '_conflict', lambda *_: '')
    monkeypatch.setattr(controller_topics, 'TwistGuard', lambda *_, **__: pytest.fail('nobody was waited for'))
    slept_s, begin_s = [], time.monotonic()
    monkeypatch.setattr(controller_topics.time, 'sleep', slept_s.append)
    monkeypatch.setattr(controller_topics.time, 'monotonic', lambda: begin_s + sum(slept_s))
    with pytest.raises(pytest.fail.Exception):
        controller_topics.RosTopics(PATIENT)
    assert sum(slept_s) == pytest.approx(6.0, abs=0.06)


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_when_the_process_that_commands_is_killed_or_stopped_its_guard_brings_the_arm_to_rest(
    graph, number, record_property
):
    """Stopped as by a debugger or a frozen cgroup: nothing ends, so that no pipe is closed."""
    places = graph.listen(PoseStamped, 'tcp_pose_broadcaster/pose')

    def x_m():
        return places[-1].pose.position.x

    with NodeProcess('texture_simulation', 'twist_controller', HELD):
        graph.until(lambda: places)
        command = [sys.executable, '-c', MOVING]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process, killed_on_error(process):
            graph.until(lambda: x_m() > places[0].pose.position.x + 0.002)
            process.send_signal(number)
            end_m = x_m()
            graph.until(lambda: len(places) > 100 and x_m() == pytest.approx(places[-100].pose.position.x, abs=1e-9))
            process.kill()
    record_property('gone_m', x_m() - end_m)
    assert x_m() - end_m < 0.005  # without a guard it never comes to rest


def test_a_publisher_whose_node_is_not_discovered_yet_is_not_named_as_dds_does():
    known = SimpleNamespace(node_namespace='/left', node_name='other')
    unknown = SimpleNamespace(node_namespace='_NODE_NAMESPACE_UNKNOWN_', node_name='_NODE_NAME_UNKNOWN_')
    assert node_of(known) == "'/left/other'"
    assert 'not discovered yet (wait some seconds and try again;' in node_of(unknown)
