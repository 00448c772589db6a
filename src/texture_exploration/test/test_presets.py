# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import pytest

from texture_core.config import load_yaml, shipped
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
    assert load_yaml(shipped('texture_exploration', 'config/presets')[name], 'preset')['paper']
    for request in load_preset(name, 1):
        motion = MOTIONS[request.motion](request, (0.0, 0.0, 0.01), TouchParams(), SafetyLimits())
        motion.refuse_too_fast(request.motion, replace(UNKNOWN_STATE, delay_s=RosControllersParams().loop_delay_s))


def test_the_first_paper_slid_at_three_speeds_and_three_forces_half_a_second_each():
    requests = load_preset('ets-linear')
    assert (len(set(requests)), len(requests)) == (9, 450)
    assert {round(request.distance_m / request.speed_m_s, 9) for request in requests} == {0.5 + LATE_S}
    assert max(request.distance_m for request in requests) == pytest.approx(0.1 + 0.2 * LATE_S)


# Values of the papers: speeds, forces, headings, distances or radii or durations, and how often.
PUBLISHED = {
    'ets-linear-headings': {'distance_m': {0.05 + 0.1 * LATE_S}, 'direction_rad': {0, 30, 45, 90}, 'repeats': 50},
    'ets-circular': {'radius_m': {0.02}, 'direction_rad': {0, 30, 45, 90}, 'repeats': 50},
    'ets-ten-textures': {'speed_m_s': {0.125}, 'force_n': {2.0}, 'distance_m': {0.1 + 0.125 * LATE_S}, 'repeats': 200},
    'ets-roughness': {'speed_m_s': {0.15}, 'force_n': {2.5}, 'distance_m': {0.105}, 'repeats': 200},
    'jamali': {'force_n': {1.0}, 'repeats': 50},
    'kaboli': {'duration_s': {2.0 + 2 * LATE_S}, 'repeats': 10},
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
    requests, published = load_preset(name), dict(PUBLISHED[name])
    assert len(requests) / len(set(requests)) == published.pop('repeats')
    for key, values in published.items():
        found = {getattr(request, key) for request in requests}
        shown = {math.degrees(value) for value in found} if key == 'direction_rad' else found
        assert sorted(shown) == pytest.approx(sorted(values))


def test_rounds_go_through_all_headings_before_they_repeat():
    headings = [math.degrees(request.direction_rad) for request in load_preset('ets-circular', 2)]
    assert headings == pytest.approx([0, 30, 45, 90] * 2)


HUGE = (10**400, math.inf, math.nan)
MISTAKES = [
    ({'motion': 'linear_slid'}, UnknownName, "did you mean 'linear_slide'"),
    ({'sped_m_s': 1.0}, InvalidParameter, "preset 'mine': no key 'sped_m_s'; did you mean 'speed_m_s'"),
    ({'force_n': 'hard'}, InvalidParameter, "'force_n' is 'hard'; a number is needed"),
    *(({'force_n': one}, InvalidParameter, r"'force_n' is .*; at most 1e\+06 is allowed") for one in HUGE),
    ({'vary': {'force_n': 2.0}}, InvalidParameter, 'each a list of numbers'),
    ({'slide_s': 1.0}, InvalidParameter, "'slide_s' needs 'speed_m_s'"),
    ({'repeats': 0}, InvalidParameter, "'repeats' is 0"),
]


@pytest.mark.parametrize(('content', 'error', 'sentence'), MISTAKES)
def test_a_mistake_in_a_preset_is_reported_with_its_place(content, error, sentence):
    with pytest.raises(error, match=sentence):
        read_preset({'motion': 'linear_slide', **content}, 'mine')


def test_an_unknown_preset_is_reported_with_the_nearest_name():
    with pytest.raises(UnknownName, match="did you mean 'ets-linear'"):
        load_preset('ets-linea')
