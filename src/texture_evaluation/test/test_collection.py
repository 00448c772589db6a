# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import CollectionError, ExplorationError, InvalidData, InvalidParameter, MotionAborted
from texture_evaluation.collection import (
    BANDS_M,
    Band,
    CollectionParams,
    Patch,
    PlaceAccuracy,
    PlacePlan,
    collect,
    evaluate_places,
    fitted_range,
    next_bag,
)
from texture_features.feature_set import LabelledFeatures, SlideConditions

PATCH = Patch(-0.05, 0.05, 0.0, 0.06)
PARAMS = CollectionParams(places=4, most_places=9, distance_m=0.02, speed_low_m_s=0.02, speed_high_m_s=0.03)


def test_the_touches_lie_on_the_patch_and_spread_over_places_directions_speeds_and_forces():
    plan = PlacePlan('oak', PARAMS, PATCH)
    touches = [plan.next() for _ in range(9)]
    for one in touches:
        ends = [
            (one.start_x_m + way * math.cos(one.direction_rad), one.start_y_m + way * math.sin(one.direction_rad))
            for way in (0.0, 0.03)  # with the ramps
        ]
        assert all(-0.05 <= x <= 0.05 and 0.0 <= y <= 0.06 for x, y in ends)
        assert (one.surface, one.use_start, one.motion) == ('oak', True, 'linear_slide')
    middles = np.array([[one.start_x_m, one.start_y_m] for one in touches]) + [
        [0.015 * math.cos(one.direction_rad), 0.015 * math.sin(one.direction_rad)] for one in touches
    ]
    distances = [math.dist(a, b) for i, a in enumerate(middles) for b in middles[:i]]
    assert min(distances) > 0.015
    angles = np.array([one.direction_rad for one in touches])
    assert np.abs(np.exp(1j * angles).mean()) < 0.6  # in all directions
    for name, low, high in (('speed_m_s', 0.02, 0.03), ('force_n', 1.0, 2.0)):
        values = [getattr(one, name) for one in touches]
        assert low <= min(values) < low * 1.2 and high / 1.2 < max(values) <= high


def test_a_patch_that_is_too_small_and_a_nameless_surface_are_refused():
    with pytest.raises(InvalidData, match=r'0\.01 m by 0\.01 m; ask for shorter slides, or touch a larger patch'):
        PlacePlan('oak', PARAMS, Patch(0.0, 0.01, 0.0, 0.01))
    with pytest.raises(InvalidData, match='no surface was named'):
        PlacePlan(' ', PARAMS, PATCH)
    with pytest.raises(InvalidParameter, match="'places' is 9; it must not be above 'most_places', 3"):
        CollectionParams(places=9, most_places=3)
    with pytest.raises(InvalidParameter, match="'force_low_n' is 3; it must not be above 'force_high_n', 2"):
        CollectionParams(force_low_n=3.0, force_high_n=2.0)
    with pytest.raises(InvalidParameter, match=r'lasts 0\.20 s at .*; 0\.6 s are needed'):
        PlacePlan('oak', CollectionParams(distance_m=0.01), PATCH)


ANY, UR5E = (0.1, 6.0), (3.0, 8.0)


@pytest.mark.parametrize(
    ('requested', 'allowed_n', 'expected_n'),
    [
        ((0.0, 0.0), ANY, (1.0, 2.0)),
        ((0.0, 0.0), UR5E, (3.0, 6.0)),
        ((0.0, 0.0), (0.1, 0.8), (0.4, 0.8)),
        ((0.0, 0.0), (1.5, 2.0), (1.5, 2.0)),
        ((3.5, 6.5), UR5E, (3.5, 6.5)),
        ((5.0, 0.0), UR5E, (5.0, 8.0)),
        ((0.0, 5.0), UR5E, (3.0, 5.0)),
        ((0.0, 0.5), ANY, (0.25, 0.5)),
        ((4.0, 4.0), UR5E, (4.0, 4.0)),
    ],
)
def test_forces_that_were_not_requested_are_those_nearest_to_the_usual_ones_that_the_explorer_allows(
    requested, allowed_n, expected_n
):
    params = replace(PARAMS, force_low_n=requested[0], force_high_n=requested[1], seed=1)
    assert fitted_range(params, ('force_low_n', 'force_high_n'), allowed_n) == pytest.approx(expected_n)
    plan = PlacePlan('oak', params, PATCH, allowed_n)
    forces_n = [plan.next().force_n for _ in range(9)]
    assert allowed_n[0] <= min(forces_n) and max(forces_n) <= allowed_n[1]
    assert min(forces_n) == pytest.approx(expected_n[0])


def test_speeds_that_were_not_requested_are_those_nearest_to_the_usual_ones_that_the_explorer_allows():
    def speeds_m_s(most_m_s, **requested):
        plan = PlacePlan('oak', CollectionParams(**requested), PATCH, allowed_speeds_m_s=(0.002, most_m_s))
        made = [plan.next().speed_m_s for _ in range(9)]
        return min(made), max(made)

    assert speeds_m_s(0.25) == pytest.approx((0.02, 0.05), rel=0.1)
    assert speeds_m_s(0.03) == pytest.approx((0.012, 0.03), rel=0.1)
    with pytest.raises(InvalidParameter, match=r"'speed_high_m_s' is 0\.05 m/s; the explorer allows 0\.002 to 0\.03"):
        speeds_m_s(0.03, speed_high_m_s=0.05)


@pytest.mark.parametrize(
    ('requested', 'named'),
    [((1.0, 2.0), 'force_low_n'), ((0.0, 2.0), 'force_high_n'), ((9.0, 0.0), 'force_low_n'), ((4, 9), 'force_high_n')],
)
def test_a_range_of_force_that_the_explorer_does_not_allow_is_refused_in_one_sentence(requested, named):
    params = replace(PARAMS, force_low_n=requested[0], force_high_n=requested[1])
    with pytest.raises(InvalidParameter, match=rf"'{named}' is \d N; the explorer allows 3 to 8 N$"):
        PlacePlan('oak', params, PATCH, UR5E)


def features(shift_of_place, n_places=6, spacing_mm=15):
    """Two surfaces at 0 and 1; a place of oak shifts its feature by some multiple of the distance of the surfaces."""
    rng = np.random.default_rng(0)
    values, labels, groups, conditions = [], [], [], {}
    for surface, centre in (('oak', 0.0), ('felt', 1.0)):
        for place in range(n_places):
            shift = shift_of_place(place) if surface == 'oak' else 0.0
            name = f'{surface}/{place}'
            values += (centre + shift + 0.1 * rng.standard_normal((10, 1))).tolist()
            labels += [surface] * 10
            groups += [name] * 10
            conditions[name] = SlideConditions(place=f'at {spacing_mm * place},0 mm')
    return LabelledFeatures(
        np.array(values), np.array(labels), np.array(groups), ('one',), 'a1', 0.5, 0.1, conditions=conditions
    )


POWER = 'signal/moments/signal_log_power/pac'


def test_a_surface_as_quiet_as_the_sensor_at_rest_ends_the_collection_with_the_sentence_of_the_training():
    def quiet(oak_level):
        found = features(lambda place: 0.0)
        levels = {'oak': oak_level, 'felt': 40.0}
        conditions = {
            name: replace(one, levels=((POWER, *[levels[name.split('/')[0]]] * 3),), rest=((POWER, 10.0),))
            for name, one in found.conditions.items()
        }
        return replace(found, conditions=conditions)

    plan, moved = PlacePlan('oak', PARAMS, PATCH), []

    def explore(request):
        moved.append(request)
        return ExplorationError.NONE, ''

    end = collect(plan, PARAMS, explore, lambda: evaluate_places(quiet(10.0), 'oak'), lambda *_: None)
    assert (end.error, len(moved)) == (CollectionError.BOUND_MISSED, 3)
    assert end.message == (
        "6 of 6 slides of 'oak' are as quiet as the sensor at rest, signal/pac 10, at rest 10: a finger that feels "
        'nothing shows the same; rejected; slide faster, press harder, or use a finer sensor, and train so'
    )
    assert evaluate_places(quiet(30.0), 'oak').quiet == ''


def test_left_out_places_are_correct_or_misidentified_as_another_surface():
    found = evaluate_places(features(lambda place: 0.0), 'oak')
    assert (found.places, found.correct, found.confused, found.others) == (6, 6, '', 1)
    # One place of six is like felt: trained on the others it is misidentified as that.
    found = evaluate_places(features(lambda place: float(place == 2)), 'oak')
    assert (found.places, found.correct, found.confused) == (6, 5, 'felt')
    # Clopper and Pearson: 6 of 6 show 0.1^(1/6) at 90 %.
    assert PlaceAccuracy(6, 6, '', 1).bound == pytest.approx(0.1 ** (1 / 6))
    assert PlaceAccuracy(6, 6, '', 0).bound == 0.0


def test_accuracy_is_given_by_the_distance_from_the_nearest_trained_place():
    # The surface changes along its track, until after 4.5 cm it is as far from its begin as felt is.
    found = evaluate_places(features(lambda place: 0.24 * place, n_places=7), 'oak')
    near, far = found.bands[0], found.bands[-1]
    assert (near.far_m, near.places) == (0.02, 7)  # the next place is 1.5 cm away
    assert near.correct / near.places > far.correct / far.places
    assert all(band.accepted <= band.correct <= band.places for band in found.bands)
    assert f'2 cm {near.correct} of 7 ({near.accepted} accepted)' in found.sentence


def test_neighbours_of_a_left_out_place_are_left_out_too():
    assert evaluate_places(features(lambda place: 0.0, n_places=2, spacing_mm=5), 'oak').places == 0
    assert evaluate_places(features(lambda place: 0.0, n_places=2), 'oak').places == 2


@pytest.mark.parametrize(
    ('bands', 'spacing_m'),  # of each band: places, correct ones, accepted and correct ones
    [
        (((6, 6, 5), (6, 6, 6), (6, 1, 0)), 0.08),
        (((6, 6, 5), (6, 1, 0), (6, 6, 6)), 0.04),
        (((6, 1, 0), (6, 6, 6), (6, 6, 6)), 0.0),
        (((2, 2, 0), (6, 6, 5)), 0.08),
        (((6, 6, 5), (2, 2, 2)), 0.04),  # too few to say more
        (((2, 2, 0),), 0.0),
        (((9, 9, 4),), 0.0),
        ((), 0.0),
    ],
)
def test_the_spacing_of_tracks_is_twice_the_farthest_good_band_with_five_accepted_places(bands, spacing_m):
    counted = tuple(Band(far_m, *counts) for far_m, counts in zip(BANDS_M, bands, strict=False))
    found = PlaceAccuracy(6, 6, '', 1, counted)
    assert found.spacing_m == pytest.approx(spacing_m)
    if bands and not spacing_m:
        assert 'spacing of tracks: unknown: at one distance 5 accepted places are needed' in found.sentence


DONE = (ExplorationError.NONE, '')


def run(evaluations, touches=(), params=PARAMS):
    """Collect; a touch that is not given is done, and one that is an exception is raised."""
    given, ends, reports = iter(evaluations), iter(touches), []

    def explore(_request):
        end = next(ends, DONE)
        if isinstance(end, BaseException):
            raise end
        return end

    end = collect(
        PlacePlan('oak', params, PATCH),
        params,
        explore,
        lambda: next(given),
        lambda sentence, slides: reports.append((slides, sentence)),
    )
    return end, reports


def test_it_ends_at_the_bound_not_before_the_fewest_places():
    end, reports = run([PlaceAccuracy(3, 3, '', 2), PlaceAccuracy(4, 3, 'felt', 2), PlaceAccuracy(6, 6, '', 2)])
    assert (end.error, end.slides) == (CollectionError.NONE, 6)
    assert [slides for slides, _ in reports] == [3, 4, 6]
    assert end.message.startswith('6 of 6 left-out places correct; at new places at least 68 %')


def test_a_bound_that_is_not_met_reports_what_is_missing():
    end, _ = run([PlaceAccuracy(places, 1, 'felt', 2) for places in (3, 4, 6, 9)])
    assert (end.error, end.slides) == (CollectionError.BOUND_MISSED, 9)
    assert 'mostly misidentified as felt' in end.message and 'also collect felt at more places' in end.message


def test_the_first_surface_of_a_folder_ends_with_the_fewest_places():
    end, _ = run([PlaceAccuracy(3, 0), PlaceAccuracy(4, 0)])
    assert (end.error, end.slides) == (CollectionError.NONE, 4)
    assert 'the folder holds no other surface yet' in end.message


def test_slides_that_add_no_place_are_explained():
    _, reports = run([PlaceAccuracy(1, 0), PlaceAccuracy(4, 0)])
    assert reports[0] == (
        3,
        '1 place; the folder holds no other surface yet; 2 fewer than slides, as a slide near another, or without a '
        'whole window (short, or samples lost), adds no place',
    )
    assert reports[1] == (4, '4 places; the folder holds no other surface yet')


def test_three_failures_in_a_row_end_it_and_two_do_not():
    failed = [(ExplorationError.FORCE_LIMIT, text) for text in ('the patch ends', 'too hard', 'a', 'b', 'c')]
    end, reports = run([PlaceAccuracy(3, 3, '', 1)] * 3, [DONE, *failed[:2], DONE, DONE, *failed[2:]])
    assert (end.error, end.slides, end.accuracy.places) == (CollectionError.MOTION_FAILED, 3, 3)
    assert end.message == '3 touches in a row failed, the last: c'
    assert (1, 'a touch failed: the patch ends') in reports


@pytest.mark.parametrize(
    ('how', 'error', 'message'),
    [
        ((ExplorationError.STOPPED, 'stopped on request'), CollectionError.STOPPED, 'stopped on request'),
        (KeyboardInterrupt('the finger is lifted'), CollectionError.CANCELLED, 'stopped: the finger is lifted'),
        (KeyboardInterrupt(), CollectionError.CANCELLED, 'stopped'),
        (InvalidData('the recorder ended: no space'), CollectionError.NOT_RECORDED, 'the recorder ended: no space'),
        (MotionAborted('it may press'), CollectionError.MOTION_FAILED, 'it may press'),
        (OSError('no space'), CollectionError.NOT_RECORDED, 'no space'),
    ],
)
def test_who_stops_it_ends_it_at_once_and_the_slides_so_far_count(how, error, message):
    end, _ = run([PlaceAccuracy(3, 3, '', 1)], [DONE, DONE, DONE, how])
    assert (end.error, end.message, end.slides, end.accuracy.correct) == (error, message, 3, 3)


def test_bags_of_a_surface_are_counted(tmp_path):
    for name in ('oak', 'oak-2', 'felt'):
        (tmp_path / name).mkdir()
    assert next_bag(tmp_path, 'oak') == tmp_path / 'oak-3'
    assert next_bag(tmp_path / 'new', 'oak') == tmp_path / 'new' / 'oak'
