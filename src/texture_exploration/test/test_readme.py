# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from texture_core.config import markdown_table
from texture_exploration.arms.simulated import SimulatedArmParams
from texture_exploration.explorer import EarlyStoppingParams
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits, SignalWatchParams
from texture_exploration.stages import TouchParams

README = (Path(__file__).parent.parent / 'README.md').read_text()


@pytest.mark.parametrize(
    'params', [SimulatedArmParams, TouchParams, SafetyLimits, EarlyStoppingParams, SignalWatchParams]
)
def test_the_readme_lists_the_parameters_as_they_are(params):
    assert markdown_table(params) in README, f'write this table into README.md:\n{markdown_table(params)}'


@pytest.mark.parametrize('name', MOTIONS)
def test_the_readme_names_every_motion(name):
    assert f'| `{name}` |' in README, f"the table of motions in README.md lacks '{name}'; add a row"
