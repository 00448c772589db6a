# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import rotation_matrix
from texture_exploration.arms.arm import SurfaceFrame
from texture_exploration.surface import SurfaceTouches, fit_surface

UP, AHEAD = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
CORNERS = [(0.3, 0.0, 0.1), (0.4, 0.0, 0.1), (0.35, 0.08, 0.1)]


def test_a_level_surface_is_found_with_its_height_and_without_a_turn():
    fit = fit_surface(CORNERS, UP, AHEAD)
    assert fit.pose == pytest.approx((0.35, 0.08 / 3, 0.1, 0.0, 0.0, 0.0))
    assert fit.residual_m == pytest.approx(0.0, abs=1e-12)


def test_touches_of_a_tilted_surface_have_the_height_zero_in_its_frame_and_z_points_away():
    axes = rotation_matrix((0.1, -0.2, 0.0))
    touches = [axes @ np.array([x, y, 0.0]) + [0.4, -0.1, 0.05] for x, y in ((0.0, 0.0), (0.1, 0.0), (0.02, 0.07))]
    frame = SurfaceFrame(fit_surface(touches, UP, AHEAD).pose)
    assert [frame.place(touch)[2] for touch in touches] == pytest.approx([0.0] * 3, abs=1e-12)
    assert frame.to_base((0.0, 0.0, 1.0)) == pytest.approx(axes[:, 2])
    ahead = np.array(AHEAD) - axes[0, 2] * axes[:, 2]
    assert frame.to_base((1.0, 0.0, 0.0)) == pytest.approx(ahead / np.linalg.norm(ahead))


def test_the_residual_is_that_of_touches_beside_the_plane():
    square = [(0.0, 0.0, 1e-4), (0.1, 0.0, -1e-4), (0.1, 0.1, 1e-4), (0.0, 0.1, -1e-4)]
    fit = fit_surface(square, UP, AHEAD)
    assert fit.residual_m == pytest.approx(1e-4)
    assert fit.largest_m == pytest.approx(1e-4)


def tilted(angle_rad):
    axes = rotation_matrix((angle_rad, 0.0, 0.0))
    return [axes @ np.array([x, y, 0.0]) for x, y in ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1))]


LINE = [(0.0, 0.0, 0.0), (0.1, 0.002, 0.0), (0.2, 0.0, 0.0)]
REFUSED = {
    'a line': (LINE, r'nearly in a line: .* 2\.0 mm, and 10 mm are needed'),
    'bent': ([*CORNERS, (0.35, 0.02, 0.12)], 'do not lie in a plane'),
    **{
        f'{angle:.0f}°': (tilted(math.radians(angle)), f'by {angle:.0f} degrees against')
        for angle in (16.0, 60.0, 90.0)
    },
}


@pytest.mark.parametrize('name', REFUSED)
def test_touches_that_make_no_plane_near_the_pose_before_are_refused_with_what_is_needed(name):
    touches, sentence = REFUSED[name]
    with pytest.raises(InvalidData, match=sentence):
        fit_surface(touches, UP, AHEAD)
    assert fit_surface(tilted(math.radians(14.0)), UP, AHEAD).pose[3] == pytest.approx(math.radians(14.0))


def test_touches_count_up_and_a_refused_one_is_not_kept():
    touches = SurfaceTouches()
    assert touches.add(CORNERS[0], UP, AHEAD) is None
    assert touches.add(CORNERS[1], UP, AHEAD) is None
    with pytest.raises(InvalidData, match='nearly in a line'):
        touches.add((0.35, 0.001, 0.1), UP, AHEAD)
    assert len(touches) == 2
    assert touches.add(CORNERS[2], UP, AHEAD) is None  # three always lie in a plane
    with pytest.raises(InvalidData, match=r'it is 1\.0 mm from touch 3'):
        touches.add((0.351, 0.08, 0.1), UP, AHEAD)
    assert touches.add((0.4, 0.08, 0.101), UP, AHEAD).residual_m > 1e-4
    touches.forget()
    assert len(touches) == 0


def test_a_fourth_touch_off_the_plane_of_the_first_three_is_refused():
    touches = SurfaceTouches()
    for corner in CORNERS:
        touches.add(corner, UP, AHEAD)
    with pytest.raises(InvalidData, match='do not lie in a plane'):
        touches.add((0.35, 0.03, 0.12), UP, AHEAD)
    assert len(touches) == 3


def test_the_pose_before_the_first_touch_counts_however_often_it_is_refined():
    touches = SurfaceTouches()
    first, *others = tilted(math.radians(20.0))
    touches.add(first, UP, AHEAD)
    touches.add(others[0], UP, AHEAD)
    with pytest.raises(InvalidData, match='turned by 20 degrees'):
        touches.add(others[1], rotation_matrix((math.radians(10.0), 0.0, 0.0))[:, 2], AHEAD)
