# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fragment of a robot description, expanded by xacro as an integrator's file includes it."""

from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest
import xacro

pytestmark = pytest.mark.ros  # xacro belongs to ROS

FRAGMENT = Path(__file__).parents[1] / 'config' / 'urdf' / 'tsf85_fingertip.urdf.xacro'
ROBOT = f"""<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="cell">
  <xacro:include filename="{FRAGMENT}"/>
  <link name="tool0"/>
  <xacro:tsf85_fingertip parent="tool0" prefix="left/"><origin xyz="0 0 0.05" rpy="0 0 0"/></xacro:tsf85_fingertip>
  <xacro:tsf85_fingertip parent="tool0" mass="0.06" height="0.02"><origin xyz="0.1 0 0"/></xacro:tsf85_fingertip>
</robot>"""


@pytest.fixture(scope='module')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Element:
    path = tmp_path_factory.mktemp('urdf') / 'cell.urdf.xacro'
    path.write_text(ROBOT)
    return fromstring(xacro.process_file(str(path)).toxml())


def place(joint: Element) -> np.ndarray:
    return np.array([float(number) for number in joint.find('origin').get('xyz').split()])


def test_links_and_joints_form_one_tree_below_the_flange(robot: Element) -> None:
    links = [link.get('name') for link in robot.iter('link')]
    joints = {j.find('child').get('link'): j.find('parent').get('link') for j in robot.iter('joint')}
    assert sorted(links) == ['fingertip', 'left/fingertip', 'left/tsf85', 'tool0', 'tsf85']
    assert set(joints) == set(links) - {'tool0'}
    assert joints['left/fingertip'] == 'left/tsf85'
    assert joints['left/tsf85'] == 'tool0'
    assert not [element.tag for element in robot.iter() if 'xacro' in element.tag]
    assert not [value for element in robot.iter() for value in element.attrib.values() if '$' in value]


def test_the_frame_of_the_fingertip_lies_on_the_contact_side(robot: Element) -> None:
    joints = {joint.get('name'): joint for joint in robot.iter('joint')}
    np.testing.assert_allclose(place(joints['left/tsf85_mount']) + place(joints['left/tsf85_contact']), [0, 0, 0.062])
    np.testing.assert_allclose(place(joints['tsf85_contact']), [0, 0, 0.02])


def test_the_inertia_is_that_of_a_solid_box(robot: Element) -> None:
    inertial = robot.find("link[@name='tsf85']/inertial")
    mass, (length, width, height) = 0.06, (0.037, 0.022, 0.02)
    expected = {
        'ixx': mass / 12 * (width**2 + height**2),
        'iyy': mass / 12 * (length**2 + height**2),
        'izz': mass / 12 * (length**2 + width**2),
    }
    inertia = inertial.find('inertia')
    assert float(inertial.find('mass').get('value')) == mass
    assert {axis: float(inertia.get(axis)) for axis in expected} == pytest.approx(expected)
