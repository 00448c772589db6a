from __future__ import annotations

import math
from dataclasses import replace

import pytest

from texture_core.types import SlideMotion, group_similar

ASKED = SlideMotion('linear_slide', 0.0, 0.1, 2.0, 1.0)


def test_what_an_arm_misses_of_the_motion_asked_for_makes_no_other_kind() -> None:
    missed = [
        replace(ASKED, speed_m_s=0.098, force_n=2.2, direction_rad=0.02),
        ASKED,
        replace(ASKED, speed_m_s=0.103, force_n=1.9, direction_rad=math.tau - 0.02),
    ]
    assert group_similar(missed) == [ASKED] * 3


@pytest.mark.parametrize(
    'other',
    [{'direction_rad': 3.0}, {'direction_rad': 0.4}, {'speed_m_s': 0.05}, {'force_n': 1.0}, {'motion': 'circular'}],
)
def test_other_directions_speeds_forces_and_names_are_other_kinds(other: dict[str, float]) -> None:
    assert group_similar([ASKED, replace(ASKED, **other)]) == [ASKED, replace(ASKED, **other)]


def test_a_kind_is_as_long_as_its_middle_slide() -> None:
    slides = [replace(ASKED, duration_s=seconds) for seconds in (0.9, 1.0, 9.0)]
    assert group_similar(slides) == [ASKED] * 3
