# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motion that ships with a paper gives the recipes that ship with it a window, on every kind of arm."""

import math

import numpy as np
import pytest

from texture_core.config import shipped as shipped_by_all
from texture_core.types import NANOSECONDS, TactileSignal
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import load_roughness_recipe
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.exploration import Exploration, no_signal_watch
from texture_exploration.motions import MOTIONS
from texture_exploration.presets import load_preset
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_features.windows import CutWindow, cut_recording

START_NS = NANOSECONDS
STEP_NS = 10_000_000  # of an exploration
# How often an arm says where it is, and how old that is: Universal Robots, rails, hands.
ARMS = {'every 2 ms': (2_000_000, 0), 'every 5 ms': (5_000_000, 0), 'every 10 ms, 15 ms late': (10_000_000, 15_000_000)}
RECIPES = {
    path.stem
    for kind in ('recipes', 'roughness')
    for path in shipped_by_all('texture_estimation', f'config/{kind}').values()
    if path.stem.startswith(('ets-', 'jamali-', 'kaboli-', 'hu-'))
}
# With what the names of the recipes begin that each preset must serve; one along a single axis serves none of two.
PRESETS = {
    'ets-linear': 'ets-linear-',
    'ets-linear-headings': 'ets-linear-',
    'ets-circular': 'ets-circular-',
    'ets-ten-textures': 'ets-fine-',
    'ets-roughness': 'ets-roughness-',
    'jamali': 'jamali-',
    'kaboli': 'kaboli-',
    'hu': 'hu-',
    'hu-cross': 'hu-',
}
PAIRS = {
    preset: sorted(one for one in RECIPES if one.startswith(begin) and not (preset == 'hu' and one.endswith('-xy')))
    for preset, begin in PRESETS.items()
}


def states_of(request, arm_step_ns, late_ns):
    """Return the states of an exploration by an arm that is stepped by hand."""
    now = [START_NS]
    arm = SimulatedArm(SimulatedArmParams(), clock=lambda: now[0], own_thread=False)
    arm.connect()
    states = []

    def pace():
        for _ in range(STEP_NS // arm_step_ns):
            now[0] += arm_step_ns
            arm.step(arm_step_ns * 1e-9)

    limits = SafetyLimits()
    motion = MOTIONS[request.motion](request, arm.state().position, TouchParams(), limits)
    exploration = Exploration(
        'one',
        request,
        arm=arm,
        motion=motion,
        limits=limits,
        clock=lambda: now[0] + late_ns,
        on_state=states.append,
        signal_fault=no_signal_watch,
    )
    outcome = exploration.run(pace)
    assert outcome.success, outcome.message
    return states


def windows_of(states, feature_set, rate_hz):
    """Return the windows of a stream that runs all the time; axes along which it is slid are kept."""
    n_samples = math.ceil((states[-1].stamp_ns - START_NS) / NANOSECONDS * rate_hz) + 1
    signal = TactileSignal(START_NS, 's', ('fast',), (), rate_hz, 0, np.zeros((n_samples, 1), dtype=np.float32))
    inputs = {'@'.join(('signal', *name.split('@')[1:])): None for name in feature_set.window_names}
    events = cut_recording({'signal': [signal]}, states, feature_set.windows, tuple(inputs))
    return [event for event in events if isinstance(event, CutWindow)]


def features_of(name):
    load = load_roughness_recipe if name.startswith('ets-roughness') else load_recipe
    return load(name).feature_set


@pytest.mark.parametrize(('step_ns', 'late_ns'), ARMS.values(), ids=ARMS)
@pytest.mark.parametrize('name', PAIRS)
def test_every_motion_of_a_preset_gives_the_recipes_of_its_paper_a_window(name, step_ns, late_ns):
    for request in load_preset(name, 1):
        states = states_of(request, step_ns, late_ns)
        for recipe in PAIRS[name]:
            assert windows_of(states, features_of(recipe), 1000.0), f'{recipe} has no window of {request}'


def test_every_shipped_preset_and_every_recipe_of_a_paper_is_asserted_above():
    shipped = shipped_by_all('texture_exploration', 'config/presets').values()
    assert {path.stem for path in shipped} == set(PAIRS)
    assert {recipe for names in PAIRS.values() for recipe in names} == RECIPES
