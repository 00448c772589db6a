# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The launch files of robots, and their presets: every name and value is one that their nodes take."""

import os
import re
from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from texture_bringup.commands.start import raised_limits, refuse_wrong
from texture_bringup.launcher import find_launch_file, read
from texture_core import config as resources
from texture_core.config import parameters_of
from texture_core.errors import InvalidLaunch, InvalidParameter
from texture_drivers.sensor import BatchParams
from texture_exploration.arms.arm import SurfacePoseParams
from texture_exploration.arms.in_hand import InHandParams
from texture_exploration.arms.rails import RailsParams
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.arms.ur import UrArmParams
from texture_exploration.guards import SignalWatchParams
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import WALL_SHARE, TouchParams
from texture_simulation.devices.twist_controller import TwistControllerParams
from texture_simulation.devices.ur import UrControllerParams
from texture_simulation.emulator import EmulatorParams
from texture_simulation.nodes.leap_hand import LeapHandParams
from texture_simulation.nodes.rails import RailsLinkParams

pytestmark = pytest.mark.ros

PRESETS = sorted((resources.folder('texture_bringup', 'config') / 'robots').glob('*.yaml'))
ROOT = Path(__file__).parents[3]
ARMS = {'ur5e': UrArmParams}
ROBOTS = ('ur', 'rails', 'hand', 'ros_controllers')
EMULATED_ROBOTS = ('ur_controller', 'rails', 'leap_hand', 'twist_controller')


def values_of(text):
    """Return all parameters in a file, whatever node they are for."""
    sections = yaml.safe_load(text)
    return {name: value for section in sections.values() for name, value in section['ros__parameters'].items()}


@pytest.mark.parametrize('path', PRESETS, ids=lambda path: path.stem)
def test_every_name_and_value_is_taken_by_the_explorer(path):
    classes = (ARMS.get(path.stem, RosControllersParams), TouchParams, SafetyLimits, SignalWatchParams)
    known = {item.name: item for cls in classes for item in parameters_of(cls)}
    values = values_of(path.read_text())
    for name, value in values.items():
        assert known[name].check(value) == value
        assert type(value) is known[name].type, name
    limits = {name: value for name, value in values.items() if name in {i.name for i in parameters_of(SafetyLimits)}}
    SafetyLimits(**limits)


def test_the_first_contact_is_the_same_with_and_without_the_driver_and_in_the_page():
    direct = values_of((PRESETS[0].parent / 'ur5e.yaml').read_text())
    [example] = re.findall(r'```yaml\n(.*?)```', (ROOT / 'docs' / 'robots.md').read_text(), re.DOTALL)
    lines = [line[3:] for line in example.splitlines()]
    page = values_of('\n'.join(lines))
    driven = values_of((PRESETS[0].parent / 'ur5e_ur_robot_driver.yaml').read_text())
    for other in (page, driven):
        shared = direct.keys() & other.keys()
        assert {'contact_force_n', 'force_limit_n', 'max_force_n', 'approach_speed_m_s'} <= shared
        assert {name: other[name] for name in shared} == {name: direct[name] for name in shared}


def test_the_page_with_the_limits_has_those_of_the_preset():
    values = values_of((PRESETS[0].parent / 'ur5e_ur_robot_driver.yaml').read_text())
    limit_n, tolerance = values['force_limit_n'], values['force_tolerance']
    page = (ROOT / 'docs' / 'motion.md').read_text()
    for expected in (
        f'`force_limit_n` {limit_n:g} N (at a wall {WALL_SHARE * limit_n:g} N)',
        f'`tangential_floor_n` {values["tangential_floor_n"]:g} N',
        f'`z_low_m` −{-values["z_low_m"]:g} m',
        f'overshoot {100 * tolerance:g} %, mean force of a slide {200 * tolerance:g} % off',
        f'`approach_travel_m` {1e3 * values["approach_travel_m"]:g} mm in at most {values["approach_timeout_s"]:g} s',
    ):
        assert expected in page.replace('\n', ' ')
    for name in ('robots', 'safety'):
        assert f'(UR5e presets {200 * tolerance:g} %)' in (ROOT / 'docs' / f'{name}.md').read_text()
    assert f'before the slide (UR5e presets {100 * tolerance:g} %)' in (ROOT / 'docs' / 'safety.md').read_text()


@pytest.mark.parametrize('emulated', ['true', 'false'])
@pytest.mark.parametrize(('robot', 'preset'), [('ur', 'ur5e'), ('ros_controllers', 'moveit_servo')])
def test_a_force_limit_above_that_of_the_preset_is_reported_with_both_values(robot, preset, emulated, tmp_path):
    def lines(limits):
        (tmp_path / 'mine.yaml').write_text(f'/**/explorer: {{ros__parameters: {{{limits}}}}}')
        given = {'emulated': emulated, 'device': 'x', 'explorer_params': str(tmp_path / 'mine.yaml')}
        more = {'preset': preset} if robot == 'ros_controllers' else {}
        return list(raised_limits(read(find_launch_file(robot), {**given, **more}, os.environ)))

    assert lines('max_force_n: 40, force_limit_n: 5.0e+1') == [
        f"'{name}' is {high} N by '{tmp_path}/mine.yaml', above the {safe} N of the preset '{preset}'"
        for name, high, safe in (('max_force_n', 40, 8), ('force_limit_n', 50, 15))
    ]
    assert lines('max_force_n: 8.0, force_limit_n: 15') == []
    assert lines('max_speed_m_s: 0.1') == []


@pytest.mark.parametrize('robot', ROBOTS)
def test_a_real_robot_comes_without_anything_emulated(robot):
    path = find_launch_file(robot)
    device = {'device': '/dev/finger'}
    emulated, real = (read(path, {'emulated': value, **device}, {}) for value in ('true', 'false'))
    with pytest.raises(InvalidLaunch, match="argument 'device' is required"):  # not the place of an emulated one
        read(path, {'emulated': 'false'}, {})
    assert {node.package for node in emulated} - {node.package for node in real} == {'texture_simulation'}
    assert {node.executable for node in real} == {'explorer', 'sensor', 'feature_extractor', 'classifier'}


@pytest.mark.parametrize('emulated', ['true', 'false'])
@pytest.mark.parametrize('robot', ROBOTS)
def test_with_a_mapping_the_adaptor_takes_the_place_of_the_sensor_also_of_an_emulated_one(robot, emulated):
    given = {'emulated': emulated, 'mapping': 'biotac_sensors', 'mapping_finger': '2'}
    found = read(find_launch_file(robot), given, {})
    nodes = {node.executable: node for node in found if node.executable not in EMULATED_ROBOTS}
    assert nodes.keys() == {'explorer', 'adaptor', 'feature_extractor', 'classifier'}
    assert len(found) == len(nodes) + (emulated == 'true')
    assert given_to(nodes['adaptor']) == {'mapping': 'biotac_sensors', 'finger': 2}


def test_a_finger_that_the_adaptor_refuses_is_refused_by_the_launch_with_its_argument():
    finger = next(item for item in parameters_of(BatchParams) if item.name == 'finger')
    given = {'mapping': 'biotac_sensors', 'mapping_finger': f'{finger.high:g}'}
    read(find_launch_file('ros_controllers'), given, {})
    with pytest.raises(InvalidLaunch, match=r"argument 'mapping_finger' is '16'; allowed is one of 0, 1, .*, 15$"):
        read(find_launch_file('ros_controllers'), {**given, 'mapping_finger': f'{finger.high + 1:g}'}, {})


def test_the_arguments_of_the_finger_of_an_included_robot_are_set_before_it(tmp_path):
    [example] = re.findall(r'`(<let [^`]*/>)`', (ROOT / 'docs/reference/launch.md').read_text())
    include = '<include file="$(find-pkg-share texture_bringup)/launch/ros_controllers.launch.xml"/>'
    file = tmp_path / 'mine.launch.xml'
    file.write_text(f'<launch>{example}{include}</launch>')
    emulator = next(node for node in read(file, {}, os.environ) if node.executable == 'emulator')
    assert given_to(emulator)['surface'] == 'leather'


@pytest.mark.parametrize('robot', ROBOTS)
def test_a_parameter_file_of_the_explorer_has_the_last_word(robot, tmp_path):
    file = tmp_path / 'my_robot.yaml'
    file.touch()
    nodes = read(find_launch_file(robot), {'explorer_params': str(file)}, {})
    explorer = next(node for node in nodes if node.executable == 'explorer')
    assert explorer.parameters[-1] == file


@pytest.mark.parametrize('robot', ['emulator', *ROBOTS])
@pytest.mark.parametrize('section', ['/**/explorr', 'explorer', '/**/classifier'])
def test_limits_in_a_section_that_does_not_reach_the_explorer_are_refused_before_anything_starts(
    robot, section, tmp_path
):
    file = tmp_path / 'my_robot.yaml'
    file.write_text(f'/**:\n  ros__parameters: {{}}\n{section}:\n  ros__parameters: {{max_force_n: 4.0}}\n')
    shown = f'/{section.lstrip("/")}'
    allowed = re.escape(
        f"has the section '{shown}', which is not for node '/p/explorer'; allowed are /**, /**/explorer,"
    )
    with pytest.raises(InvalidParameter, match=allowed):
        refuse_wrong(read(find_launch_file(robot), {'namespace': 'p', 'explorer_params': str(file)}, os.environ))


@pytest.mark.parametrize(
    ('robot', 'node', 'params', 'pose'),
    [('ur', 'ur_controller', UrControllerParams, 3), ('ros_controllers', 'twist_controller', TwistControllerParams, 6)],
)
def test_the_emulated_surface_lies_where_the_file_of_the_explorer_says(robot, node, params, pose, tmp_path):
    file = tmp_path / 'my_robot.yaml'
    file.touch()
    nodes = read(find_launch_file(robot), {'explorer_params': str(file)}, {})
    assert file in next(one for one in nodes if one.executable == node).parameters
    declared = {item.name for item in parameters_of(SurfacePoseParams)}
    assert len(declared & {item.name for item in parameters_of(params)}) == pose


def given_to(node):
    """Return the parameters that a launch file itself gives to a node."""
    return {name: value for one in node.parameters if not isinstance(one, Path) for name, value in one.items()}


@pytest.mark.parametrize('robot', ['emulator', *ROBOTS])
def test_two_emulated_instances_share_no_device_if_their_namespaces_differ(robot, monkeypatch):
    monkeypatch.setenv('XDG_RUNTIME_DIR', '/run/user/1000')

    def devices(given):
        found = {}
        for node in read(find_launch_file(robot), given, os.environ):
            found |= given_to(node)
        return {value for value in found.values() if str(value).startswith('/run/user/1000/tactile_texture/')}

    alone, left, right = (devices(given) for given in ({}, {'namespace': 'left'}, {'namespace': 'right'}))
    assert len(alone) == len(left) == len(right) >= 2  # the sensor and the pipe of the finger, and what moves it
    assert not left & right
    assert not any('//' in path for path in alone | left)


@pytest.mark.parametrize(
    ('robot', 'node', 'params'),
    [
        ('emulator', 'emulator', EmulatorParams),
        ('rails', 'rails', RailsLinkParams),
        ('rails', 'explorer', RailsParams),
        ('hand', 'leap_hand', LeapHandParams),
        ('hand', 'explorer', InHandParams),
    ],
)
def test_a_node_started_alone_looks_for_emulated_devices_where_launch_files_put_them(robot, node, params):
    given = {}
    for launched in read(find_launch_file(robot), {}, os.environ):
        if launched.executable == node:
            given |= given_to(launched)
    defaults = asdict(params())
    assert any(name in given and given[name] == defaults[name] for name in ('device', 'link', 'sensor_link'))
