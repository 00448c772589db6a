# SPDX-License-Identifier: Apache-2.0
"""The presets of robots: every name and value is one that their nodes take, and the pages agree with them."""

import re
from pathlib import Path

import pytest
import yaml

from texture_core import config as resources
from texture_core.config import parameters_of
from texture_exploration.arms.ros_controllers import RosControllersParams
from texture_exploration.arms.ur import UrArmParams
from texture_exploration.safety import SafetyLimits, SignalWatchParams
from texture_exploration.stages import TouchParams

PRESETS = sorted((resources.folder('texture_bringup', 'config') / 'robots').glob('*.yaml'))
ROOT = Path(__file__).parents[3]
ARMS = {'ur5e': UrArmParams}


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
