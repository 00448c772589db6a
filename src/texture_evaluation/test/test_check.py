# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The daily check from bags of simulated slides: a finger with another gain, and one that is as trained."""

from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import ExplorationRequest, Phase
from texture_estimation.model import load_model
from texture_evaluation.check import adapt_to_today, check_finger, store_reference
from texture_evaluation.train import train_from_bags
from texture_features.correction import read_reference
from texture_features.feature_set import FeatureSet
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated

PLAN = SlidePlan(slides=6, speed_m_s=0.05, force_n=1.0, slide_s=3.0)


@pytest.fixture(scope='module')
def trained(tmp_path_factory):
    """A model of three surfaces, and six slides over one of them, its reference plate."""
    folder = tmp_path_factory.mktemp('check')
    bags = write_simulated(folder / 'bags', PLAN, np.random.default_rng(0), surfaces=('glass', 'leather', 'cardboard'))
    train_from_bags('default', bags, out=folder / 'three')
    return folder / 'three', SlideDataset.from_bags([folder / 'bags' / 'leather']).slides


TOPICS = ('signal',)
REQUEST = ExplorationRequest('linear_slide', speed_m_s=0.03, force_n=5.0, distance_m=0.08, direction_rad=0.5)


def check(model, slide, **options):
    return check_finger(model, TOPICS, read_reference(model)[0], slide, **options)


def louder(slide, factor):
    signals = {
        topic: [replace(one, samples=one.samples * np.float32(factor)) for one in batches]
        for topic, batches in slide.signals.items()
    }
    return replace(slide, signals=signals)


def test_a_finger_is_checked_corrected_and_found_as_trained_again(trained):
    model, slides = trained
    [rest_in_training] = load_model(model).acceptance.domain.rest.values()
    store_reference(model, TOPICS, [slides[5], slides[0]], REQUEST)
    as_trained, sentence = check(model, slides[1])
    assert as_trained and ': signal gain ' in sentence

    as_trained, sentence = check(model, louder(slides[2], 2.0))
    assert not as_trained
    assert 'the gain changed by +6.' in sentence or 'the gain changed by +5.' in sentence
    assert sentence.endswith('Check that this is the reference plate; clean or replace the skin, or use --correct')

    _, sentence = check(model, louder(slides[2], 2.0), correct=True)
    assert 'start the nodes again with its model card as recipe' in sentence
    as_trained, sentence = check(model, louder(slides[4], 2.0))
    assert as_trained and sentence.startswith("with its correction, '") and 'as trained' in sentence
    as_trained, sentence = check(model, louder(slides[4], 6.0))
    assert not as_trained
    assert 'also with its correction' in sentence and sentence.endswith('train with this finger')
    as_trained, sentence = check(model, slides[4])
    assert not as_trained
    assert sentence.endswith('corrects another one; remove that by --correct')
    corrected = load_model(model)
    of_extractor = FeatureSet.load(f'{model}.json')  # what the node loads
    for feature_set in (corrected.recipe.feature_set, of_extractor):
        dataset = SlideDataset((louder(slides[3], 2.0),)).features(feature_set)
        assert dataset.feature_set == corrected.feature_set
        assert set(corrected.decide(dataset.values)) == {'leather'}
    assert [*corrected.acceptance.domain.rest.values()] == [rest_in_training]  # the noise may be as it was
    plain = SlideDataset((slides[3],)).features(FeatureSet.load('default'))
    assert plain.feature_set != corrected.feature_set

    as_trained, sentence = check(model, slides[4], correct=True)  # the old finger is back
    assert as_trained and sentence.endswith('its correction is removed')
    assert load_model(model).feature_set == plain.feature_set


def test_a_jerk_of_the_arm_is_no_other_finger_and_three_decibels_are(trained):
    model, slides = trained
    store_reference(model, TOPICS, slides[:2], REQUEST)
    for slide in slides[2:]:
        batches = slide.signals['signal']
        jerk = [replace(one, samples=one.samples.copy()) for one in batches]
        middle = jerk[len(jerk) // 2]
        level = np.median(middle.samples, axis=0)
        part = slice(len(middle.samples) // 2, len(middle.samples) // 2 + round(0.2 * middle.sampling_rate_hz))
        middle.samples[part] = level + 10.0 * (middle.samples[part] - level)
        as_trained, sentence = check(model, replace(slide, signals={'signal': jerk}))
        assert as_trained, sentence
        for decibels in (-3.0, 3.0):
            as_trained, sentence = check(model, louder(slide, 10.0 ** (decibels / 20.0)))
            assert not as_trained, sentence


def test_a_slide_with_lost_samples_is_refused_with_advice_for_an_operator(trained):
    model, slides = trained
    *before, last = slides[2].signals['signal']
    after = replace(last, first_sample=last.first_sample + 100, samples=last.samples[100:])
    assert before
    signals = {'signal': [*before, after]}
    with pytest.raises(InvalidData, match=r"samples of 'signal' were lost .*; stop other programs .* and check again"):
        check_finger(model, TOPICS, {}, replace(slides[2], signals=signals))


def paused(slide, count, name):
    """A slide, with a state each 100 ms, in which `count` states are missing, or show the finger at one place."""
    moved = [replace(one, x_m=1e-3 * number, y_m=0.0) for number, one in enumerate(slide.sliding)]
    still = [replace(one, x_m=moved[20].x_m) for one in moved[21 : 21 + count]] if name == 'still' else []
    others = [one for one in slide.states if one.phase is not Phase.SLIDE]
    return replace(slide, states=[*others, *moved[:21], *still, *moved[21 + count :]])


@pytest.mark.parametrize('name', ['late', 'still'])
def test_a_slide_in_which_the_arm_paused_is_refused_and_gives_no_verdict(trained, name):
    model, slides = trained
    store_reference(model, TOPICS, slides[:2], REQUEST)
    assert check(model, paused(slides[2], 0, name))[0]
    for slide in (paused(slides[2], 1, name), louder(paused(slides[2], 1, name), 2.0)):
        with pytest.raises(InvalidData, match=r'the arm paused for 200 ms .*\(100 ms .*\(10 Hz; above .*, and repeat$'):
            check(model, slide)
    with pytest.raises(InvalidData, match='the arm paused'):
        store_reference(model, TOPICS, [slides[0], paused(slides[1], 1, name)], REQUEST)


def test_a_slow_pose_is_named_and_an_arm_that_begins_late_did_not_pause(trained):
    model, slides = trained
    store_reference(model, TOPICS, slides[:2], REQUEST)
    moved = [replace(one, x_m=1e-3 * max(number, 2), y_m=0.0) for number, one in enumerate(slides[2].sliding)]
    assert check(model, replace(slides[2], states=moved))[0]
    first_ns = moved[0].stamp_ns
    slow = [replace(one, stamp_ns=first_ns + 10 * (one.stamp_ns - first_ns) // 9) for one in moved[:-5]]
    with pytest.raises(
        InvalidData, match=r'paused for 111 ms .*, or raise the rate of its pose \(9 Hz; above 10 Hz is'
    ):
        check(model, replace(slides[2], states=slow))


def test_a_finger_that_became_weak_gets_a_verdict_but_no_reference_and_no_correction(trained):
    model, slides = trained
    store_reference(model, TOPICS, slides[:2], REQUEST)
    faint = 0.5 * np.random.default_rng(2).standard_normal((60_000, 1)).astype(np.float32)
    first = slides[2].signals['signal'][0]
    level, fraction = np.float32(np.median(first.samples)), np.float32(1e-4)
    signals = [
        replace(one, samples=level + fraction * (one.samples - level) + faint[: len(one.samples)])
        for one in slides[2].signals['signal']
    ]
    before = replace(slides[2].states[0], stamp_ns=first.stamp_ns, phase=Phase.APPROACH)
    touch = replace(before, stamp_ns=first.stamp_ns + 800_000_000, phase=Phase.CONTACT)
    weak = replace(slides[2], signals={'signal': signals}, states=[before, touch, *slides[2].sliding])
    as_trained, sentence = check(model, weak)
    assert not as_trained and 'the gain changed by -' in sentence
    with pytest.raises(InvalidData, match=r'the slide over the plate has .* rms and the rest .*: too little signal'):
        check(model, weak, correct=True)
    with pytest.raises(InvalidData, match='too little signal'):
        store_reference(model, TOPICS, [weak, weak], REQUEST)


def test_the_reference_tells_how_its_slide_was_made(trained):
    model, slides = trained
    store_reference(model, TOPICS, slides[:2], REQUEST)
    assert read_reference(model)[1] == {
        'speed_m_s': 0.03, 'force_n': 5.0, 'distance_m': 0.08, 'direction_rad': 0.5
    }  # fmt: skip
    assert check(model, slides[2])[0]


def test_slides_of_the_training_are_none_of_today_and_the_training_has_to_be_whole(trained, tmp_path):
    model, bags = trained[0], trained[0].parent / 'bags'
    with pytest.raises(
        InvalidData, match=r"^6 of the 6 slides of today are slides of the training, the first 'glass/1'"
    ):
        adapt_to_today(model, [bags], [bags / 'glass'])
    with pytest.raises(InvalidData, match=r'^6 of the 6 slides of today'):  # whatever is given as training
        adapt_to_today(model, [bags / 'leather'], [bags / 'glass'])
    [today] = write_simulated(tmp_path, replace(PLAN, slides=1), np.random.default_rng(1), surfaces=('glass',))
    with pytest.raises(
        InvalidData, match="also trained on 'cardboard', of which the bags of the training hold no slide; give all"
    ):
        adapt_to_today(model, [bags / 'leather', bags / 'glass'], [today])


def test_a_reference_is_stored_only_if_a_second_slide_shows_the_same(trained):
    model, slides = trained
    path = model.with_name('three.reference.json')
    path.unlink(missing_ok=True)
    with pytest.raises(InvalidData, match=r'^nothing is stored, .* differ: signal: the gain changed by \+[56].*again$'):
        store_reference(model, TOPICS, [slides[0], louder(slides[1], 2.0)], REQUEST)
    with pytest.raises(InvalidData, match='record two, and store again'):
        store_reference(model, TOPICS, slides[:1], REQUEST)
    assert not path.exists()


def test_noise_and_drift_are_measured_where_there_is_rest_and_else_reported_as_missing(trained, tmp_path, monkeypatch):
    model, recorded = trained
    slides = [replace(one, states=[at for at in one.states if at.phase is not Phase.APPROACH]) for one in recorded]
    stored = store_reference(model, TOPICS, slides[:2], REQUEST)
    assert 'noise and drift were not measured' in stored
    assert 'NaN' not in model.with_name('three.reference.json').read_text()
    as_trained, sentence = check(model, slides[2])
    assert as_trained and sentence.startswith('gain and response are as trained, noise and drift were not measured')
    assert 'nan' not in sentence

    monkeypatch.setattr('texture_simulation.offline.APPROACH_S', 0.9)
    [bag] = write_simulated(tmp_path, replace(PLAN, slides=3), np.random.default_rng(1), surfaces=('leather',))
    longer = SlideDataset.from_bags([bag]).slides
    assert 'not measured' not in store_reference(model, TOPICS, longer[:2], REQUEST)
    as_trained, sentence = check(model, longer[2])
    assert as_trained and sentence.startswith('the finger is as trained: signal gain ')
    assert 'noise × 1.0, drift 0.0 rms' in sentence
