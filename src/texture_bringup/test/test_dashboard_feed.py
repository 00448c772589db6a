# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import replace

import numpy as np
import pytest

from texture_bringup.feed import (
    BINS,
    MAX_LIGHTS,
    POINTS,
    SILENT_S,
    Feed,
    NodeStatuses,
    Ring,
    number_text,
    spectrum_db,
    texture_text,
)
from texture_core.types import (
    ExplorationState,
    ModelInfo,
    Phase,
    Rejection,
    RoughnessEstimate,
    TactileSignal,
    TextureEstimate,
)


def batch(first, samples, rate_hz=1000.0, channels=('dynamic',)):
    samples = np.asarray(samples, dtype=np.float32).reshape(-1, len(channels))
    return TactileSignal(0, 'tsf85', channels, ('count',) * len(channels), rate_hz, first, samples)


def sliding(exploration_id, phase=Phase.SLIDE):
    return ExplorationState(1, exploration_id, 'linear_slide', phase, speed_m_s=0.05, force_n=1.0, progress=0.5)


def test_a_ring_keeps_the_newest_and_leaves_a_gap_where_samples_are_lost() -> None:
    ring = Ring(0.01)
    ring.update(batch(0, range(8)))
    ring.update(batch(10, [10, 11, 12]))
    np.testing.assert_array_equal(ring.newest(1.0), [3, 4, 5, 6, 7, np.nan, np.nan, 10, 11, 12])


def test_a_sine_of_amplitude_one_is_a_line_of_zero_decibels() -> None:
    levels = spectrum_db(np.sin(2 * np.pi * 125 * np.arange(512) / 1000), 128)
    assert np.argmax(levels) == pytest.approx(128 * 125 / 500, abs=1)
    assert levels.max() == pytest.approx(0.0, abs=0.1)


def test_taxels_are_shown_from_their_rest_and_a_touch_does_not_move_it() -> None:
    feed = Feed()
    feed.on_static(batch(0, [100.0, 50.0], 60.0, ('taxel_0_0', 'taxel_0_1')))
    feed.on_state(sliding('a'))
    for k in range(1, 200):
        feed.on_static(batch(k, [130.0, 50.0], 60.0, ('taxel_0_0', 'taxel_0_1')))
    assert feed.frame(0.0)['taxels']['values'] == [30.0, 0.0]


@pytest.mark.parametrize(
    ('reports', 'expected'),
    [
        ([], 'no estimate yet, and no classifier reports on /diagnostics'),
        ([('classifier', 'OK', 'classifying')], 'no estimate yet'),
        ([('classifier', 'WARN', 'no model is loaded; set it')], 'no estimate yet: no model is loaded; set it'),
    ],
)
def test_before_an_estimate_the_page_shows_why_there_is_none(reports, expected) -> None:
    feed = Feed()
    for name, level, message in reports:
        feed.node_statuses.update(name, level, message, 0.0)
    feed.on_state(sliding('a'))
    assert feed.frame(0.5)['texture']['note'] == ('no estimate yet' if not reports else expected)
    assert feed.frame(1.0 + SILENT_S)['texture']['note'] == expected
    feed.on_texture(TextureEstimate(2, 'a', 'felt', Rejection.NONE, 0.9))
    assert feed.frame(1.0)['texture']['note'] == 'confidence 0.90'


@pytest.mark.parametrize(
    ('rejection', 'listed'),
    [
        (Rejection.NONE, 'glass'),
        (Rejection.NOVEL, 'glass?, rejected: novel'),
        (Rejection.AMBIGUOUS, 'glass?, rejected: ambiguous'),
    ],
)
def test_a_past_exploration_is_listed_with_its_rejection(rejection, listed) -> None:
    feed = Feed()
    feed.on_state(sliding('a'))
    assert feed.frame(0.0)['past'] == [{'id': 'a', 'text': 'linear_slide · slide · no label · a'}]
    feed.on_texture(TextureEstimate(2, 'a', 'glass', rejection, 0.9))
    assert feed.frame(0.0)['past'][0]['text'] == f'linear_slide · slide · {listed} · a'
    feed.on_state(replace(sliding('a'), phase=Phase.DONE, surface='cork'))
    feed.on_roughness(RoughnessEstimate(2, 'a', True, 3.25, 0.5))
    assert feed.frame(0.0)['past'][0]['text'] == f'linear_slide · done · {listed} · (over cork) · roughness 3.2 · a'


@pytest.mark.parametrize(
    ('estimate', 'shown', 'note'),
    [
        (
            TextureEstimate(2, 'a', 'felt', Rejection.NONE, 0.912, windows=9, evidence_s=2.26),
            'felt',
            'confidence 0.91 · 9 windows, 2.3 s',
        ),
        (
            TextureEstimate(2, 'a', 'felt', Rejection.NOVEL, 0.6, windows=3, evidence_s=1.0),
            'felt?',
            'confidence 0.60 · 3 windows, 1.0 s · rejected: novel',
        ),
        (TextureEstimate(2, 'a', windows=2, evidence_s=0.6, message='too short'), '–', '2 windows, 0.6 s · too short'),
    ],
)
def test_an_estimate_is_shown_with_a_question_mark_unless_it_is_accepted_and_with_what_it_rests_on(
    estimate, shown, note
) -> None:
    feed = Feed()
    feed.on_state(sliding('a'))
    feed.on_texture(estimate)
    texture = feed.frame(0.0)['texture']
    assert (texture['shown'], texture['note']) == (shown, note)


def test_numbers_are_shown_with_their_unit_and_unknown_ones_as_a_dash() -> None:
    feed = Feed()
    feed.on_state(sliding('a'))
    feed.on_roughness(RoughnessEstimate(2, 'a', True, 2.0, 0.52))
    frame = feed.frame(0.0)
    assert (frame['state']['speed'], frame['state']['force']) == ('0.050 m/s', '1.00 N')
    roughness = frame['roughness']
    assert (roughness['shown'], roughness['note']) == ('2.0', '± 0.5')
    feed.on_roughness(RoughnessEstimate(3, 'a', message='too short'))
    roughness = feed.frame(0.0)['roughness']
    assert (roughness['shown'], roughness['note']) == ('–', 'too short')
    assert Feed().frame(0.0)['state']['force'] == '–'
    assert number_text('speed_m_s', 'm/s', 0.002, 0.25) == 'speed (m/s), 0.002 to 0.25'
    assert number_text('distance_m', 'm', 0.01, 1.0) == 'distance (m), 0.01 to 1 within the workspace'
    assert number_text('turns', 'turns', 1.0, 10.0) == 'turns, 1 to 10'


def test_a_finger_that_may_press_after_a_restart_of_the_explorer_is_a_warning_until_it_is_lifted() -> None:
    feed = Feed()
    free, unknown = (ExplorationState(2, '', '', Phase.IDLE, lifted=lifted) for lifted in (True, False))
    feed.on_state(unknown)
    assert feed.frame(0.0)['warning'] == ''  # nothing was touched yet
    feed.on_state(sliding('a'))
    assert feed.frame(0.0)['warning'] == ''
    feed.on_state(unknown)
    assert feed.frame(0.0)['warning'] == 'the finger may still press: look at the robot, and call `texture lift`'
    feed.on_state(free)
    assert feed.frame(0.0)['warning'] == ''
    feed.on_state(sliding('b'))
    feed.on_state(replace(sliding('b'), phase=Phase.DONE, lifted=True))
    feed.on_state(unknown)  # taken control of again, after `texture deactivate`
    assert feed.frame(0.0)['warning'] == ''
    feed.on_state(replace(sliding('c'), phase=Phase.ABORTED))  # and not lifted
    feed.on_state(unknown)
    assert feed.frame(0.0)['warning'] != ''


ELSEWHERE = 'trained at one place of each surface: elsewhere it may be rejected'


@pytest.mark.parametrize(
    ('label', 'rejection', 'reason'),
    [
        (
            'glass',
            Rejection.NOVEL,
            'unknown (nearest: glass, confidence 0.91 after 1.5 s): it resembles no trained texture',
        ),
        ('', Rejection.AMBIGUOUS, 'unknown (nearest: several, confidence 0.91 after 1.5 s): ambiguous'),
    ],
)
def test_the_reason_of_a_rejection_is_shown_before_what_the_model_notes(label, rejection, reason) -> None:
    estimate = TextureEstimate(2, 'a', label, rejection, 0.91, windows=4, evidence_s=1.5, message=ELSEWHERE)
    assert texture_text(estimate) == f'{reason}; {ELSEWHERE}'
    assert texture_text(TextureEstimate(2, 'a', message='no model is loaded')) == 'no model is loaded'


def test_a_frame_shows_what_came_and_stays_small() -> None:
    feed = Feed()
    feed.on_signal(batch(0, np.random.default_rng(0).normal(size=5000)))
    feed.on_state(sliding('a'))
    feed.on_model(ModelInfo(1, 'm', 3, ('cork', 'felt')))
    feed.on_texture(TextureEstimate(2, 'a', 'felt', Rejection.NONE, 0.9, (0.1, 0.9), model='m', revision=3))
    feed.on_roughness(RoughnessEstimate(2, 'a', True, 3.25, 0.5))
    frame = feed.frame(0.0)
    text = json.dumps(frame, allow_nan=False)
    assert (frame['texture']['labels'], frame['texture']['probabilities']) == (['felt', 'cork'], [0.9, 0.1])
    assert (frame['roughness']['grade'], frame['state']['speed_m_s']) == (3.25, 0.05)
    assert (len(frame['signal']['low']), len(frame['spectrum']['db'])) == (POINTS, BINS)
    assert len(text) < 10_000


def test_a_new_exploration_begins_without_evidence_and_a_late_estimate_enters_only_its_own_summary() -> None:
    feed = Feed()
    feed.on_state(sliding('a'))
    feed.on_texture(TextureEstimate(2, 'a', 'felt', Rejection.NONE, 0.6))
    feed.on_state(sliding('b'))
    feed.on_texture(TextureEstimate(3, 'a', 'cork', Rejection.NONE, 0.9))
    frame = feed.frame(0.0)
    assert frame['texture']['label'] == ''
    assert [past['text'] for past in frame['past']] == [
        f'linear_slide · slide · {one}' for one in ('no label · b', 'cork · a')
    ]


def test_a_failing_node_and_a_silent_one_are_red() -> None:
    node_statuses = NodeStatuses()
    node_statuses.update('sensor', 'ERROR', 'unplugged', 0.0)
    node_statuses.update('explorer', 'OK', 'the arm answers', 0.0)
    assert {light['name']: light['colour'] for light in node_statuses.shown(1.0)} == {
        'sensor': 'red',
        'explorer': 'green',
    }
    silent = {light['name']: light for light in node_statuses.shown(SILENT_S + 1)}
    assert {(light['colour'], light['there']) for light in silent.values()} == {('red', False)}
    assert silent['explorer']['message'].startswith('silent for 6 s; its last message: the arm answers; the arm may')
    assert 'the arm may continue to press' not in silent['sensor']['message']
    for number in range(200):
        node_statuses.update(f'node{number}', 'OK', 'x' * 10_000, 2.0)
    assert len(node_statuses.shown(2.0)) == MAX_LIGHTS


def test_a_node_that_ended_well_is_grey_until_it_is_started_again() -> None:
    lights = NodeStatuses()
    lights.update('record', 'OK', '12 messages recorded, nothing lost', 0.0, ended=True)
    ended = {'name': 'record', 'colour': 'grey', 'message': 'ended: 12 messages recorded, nothing lost', 'there': False}
    assert lights.shown(1.0) == lights.shown(SILENT_S + 100.0) == [ended]
    lights.update('record', 'WARN', '3 lost samples', 200.0, ended=True)
    assert lights.shown(300.0)[0]['colour'] == 'yellow'
    lights.update('record', 'OK', 'recording', 301.0)
    assert (lights.shown(302.0)[0]['colour'], lights.shown(302.0)[0]['there']) == ('green', True)
    assert lights.shown(302.0 + SILENT_S)[0]['colour'] == 'red'
