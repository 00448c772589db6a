# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import pytest

from texture_core.config import shipped
from texture_core.errors import InvalidParameter, UnknownName
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.lift_first import UNKNOWN_STATE
from texture_exploration.motions import MOTIONS
from texture_exploration.presets import load_preset, read_preset
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

# A slide is longer than the recording of its paper by so much: an arm that answers late still covers all of that.
LATE_S = 0.05
PRESETS = sorted(shipped('texture_exploration', 'config/presets'))


@pytest.mark.parametrize('name', PRESETS)
def test_every_motion_of_a_preset_can_be_planned_with_all_defaults(name):
    preset = load_preset(name)
    assert preset.paper
    for request in preset.requests:
        motion = MOTIONS[request.motion](request, (0.0, 0.0, 0.01), TouchParams(), SafetyLimits())
        motion.refuse_too_fast(request.motion, replace(UNKNOWN_STATE, delay_s=RosControllersParams().loop_delay_s))


def test_the_first_paper_slid_at_three_speeds_and_three_forces_half_a_second_each():
    preset = load_preset('ets-linear')
    assert len(preset.requests) == 9
    assert len(preset.all()) == 450
    assert {round(request.distance_m / request.speed_m_s, 9) for request in preset.requests} == {0.5 + LATE_S}
    assert max(request.distance_m for request in preset.requests) == pytest.approx(0.1 + 0.2 * LATE_S)


# Values of the papers: speeds, forces, headings, distances or radii or durations, and how often.
PUBLISHED = {
    'ets-linear-headings': {'distance_m': {0.05 + 0.1 * LATE_S}, 'direction_rad': {0, 30, 45, 90}, 'repeats': 50},
    'ets-circular': {'radius_m': {0.02}, 'direction_rad': {0, 30, 45, 90}, 'repeats': 50},
    'ets-ten-textures': {'speed_m_s': {0.125}, 'force_n': {2.0}, 'distance_m': {0.1 + 0.125 * LATE_S}, 'repeats': 200},
    'ets-roughness': {'speed_m_s': {0.15}, 'force_n': {2.5}, 'distance_m': {0.105}, 'repeats': 200},
    'jamali': {'force_n': {1.0}, 'repeats': 50},
    'kaboli': {'duration_s': {2.0 + 2 * LATE_S}, 'repeats': 10},
    'kaboli-random': {'distance_m': {0.03}, 'repeats': 10},
    'hu-cross': {'speed_m_s': {0.0255}, 'force_n': {1.5}, 'direction_rad': {0}, 'repeats': 60},
    'hu': {
        'speed_m_s': {0.0255},
        'force_n': {1.5},
        'direction_rad': {0, 90},
        'distance_m': {0.0255 * (12_288 / 4096 + 2 * LATE_S)},
        'repeats': 60,
    },
}


@pytest.mark.parametrize('name', PUBLISHED)
def test_a_preset_holds_what_its_paper_reports(name):
    preset, published = load_preset(name), dict(PUBLISHED[name])
    assert preset.repeats == published.pop('repeats')
    for key, values in published.items():
        found = {getattr(request, key) for request in preset.requests}
        shown = {math.degrees(value) for value in found} if key == 'direction_rad' else found
        assert sorted(shown) == pytest.approx(sorted(values))


def test_rounds_go_through_all_headings_before_they_repeat():
    headings = [math.degrees(request.direction_rad) for request in load_preset('ets-circular').all(2)]
    assert headings == pytest.approx([0, 30, 45, 90] * 2)


def test_a_mistake_in_a_preset_is_reported_with_its_place():
    slide = {'motion': 'linear_slide'}
    with pytest.raises(UnknownName, match="did you mean 'ets-linear'"):
        load_preset('ets-linea')
    with pytest.raises(UnknownName, match="did you mean 'linear_slide'"):
        read_preset({'motion': 'linear_slid'}, 'mine')
    with pytest.raises(InvalidParameter, match="preset 'mine': no key 'sped_m_s'; did you mean 'speed_m_s'"):
        read_preset({**slide, 'sped_m_s': 1.0}, 'mine')
    with pytest.raises(InvalidParameter, match="'force_n' is 'hard'; a number is needed"):
        read_preset({**slide, 'force_n': 'hard'}, 'mine')
    for number in (10**400, math.inf, math.nan):
        with pytest.raises(InvalidParameter, match=r"'force_n' is .*; at most 1e\+06 is allowed"):
            read_preset({**slide, 'force_n': number}, 'mine')
    with pytest.raises(InvalidParameter, match='a list of numbers is needed'):
        read_preset({**slide, 'vary': {'force_n': 2.0}}, 'mine')
    with pytest.raises(InvalidParameter, match="'slide_s' needs 'speed_m_s'"):
        read_preset({**slide, 'slide_s': 1.0}, 'mine')
    with pytest.raises(InvalidParameter, match="'repeats' is 0"):
        read_preset({**slide, 'repeats': 0}, 'mine')
