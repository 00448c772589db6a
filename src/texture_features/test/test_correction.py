# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest

from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import Window
from texture_features.correction import (
    Correction,
    InputStatistics,
    compare,
    file_next_to,
    read_correction,
    read_reference,
    write_reference,
)
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, WindowBatch

RATE_HZ = 2200.0


def slide(seed=0, channels=1, seconds=6.0):
    """Noise that falls by frequency, as a surface gives."""
    rng = np.random.default_rng(seed)
    white = np.fft.rfft(rng.standard_normal((round(seconds * RATE_HZ), channels)), axis=0)
    return 100.0 * np.fft.irfft(white / np.sqrt(1.0 + np.arange(len(white)) / 1000.0)[:, None], axis=0)


def through(samples, response_db):
    spectrum = np.fft.rfft(samples, axis=0)
    hertz = np.fft.rfftfreq(len(samples), 1.0 / RATE_HZ)
    return np.fft.irfft(spectrum * 10 ** (response_db(hertz) / 20)[:, None], len(samples), axis=0)


def found(samples, rest=None, sensor='biotac', channels=('pac',)):
    rest = np.random.default_rng(9).standard_normal((2200, samples.shape[1])) if rest is None else rest
    return InputStatistics.of(samples, rest, RATE_HZ, channels, sensor)


def test_the_same_finger_has_no_fault_on_another_slide():
    same = compare(found(slide(0)), found(slide(1)))
    assert same.faults == [] and abs(same.gain_db[0]) < 0.3 and same.noise_ratio == pytest.approx(1.0)


def test_gain_and_frequency_response_are_found_and_named():
    louder = compare(found(slide(0)), found(2.0 * slide(1)))
    assert louder.gain_db[0] == pytest.approx(20 * np.log10(2.0), abs=0.3)
    assert compare(found(slide(0)), found(2.0 * slide(0))).faults == ['the gain changed by +6.0 dB']

    def tilt(hertz):
        return 6.0 * hertz / 1100.0 - 3.0

    tilted = compare(found(slide(0)), found(through(slide(1), tilt)))
    assert np.abs(tilted.response_db[:, 0] - tilt(tilted.frequencies_hz)).max() < 0.7
    assert tilted.faults[0].startswith('the frequency response differs by 1.')


def test_dead_taxels_noise_and_drift_are_named():
    names, before, after = ('a', 'b', 'c'), slide(0, 3), slide(1, 3)
    after[:, 1] *= 0.01
    rest = np.random.default_rng(3).standard_normal((2200, 3))
    worn = compare(found(before, rest, channels=names), found(after, 3.0 * rest + 1000.0, channels=names))
    assert 'dead: b' in worn.faults
    assert any('3.0 times as strong' in fault for fault in worn.faults)
    assert any('the level at rest drifted' in fault for fault in worn.faults)


def test_a_corrected_window_has_the_features_of_the_finger_of_the_training():
    def wavy(hertz):
        return 3.0 * np.cos(np.pi * hertz / 1100.0)

    correction = Correction.of({'signal': compare(found(slide(0)), found(through(slide(1), wavy)))})
    plain = FeatureSet.from_mapping({'inputs': {'signal': {'features': [{'mean_log_bands': {'bands': 16}}]}}})
    other = FeatureSet(plain.windows, plain.inputs, correction)

    def features(feature_set, samples):
        window = Window(samples[2000:3100], RATE_HZ, ('pac',))
        return feature_set.extract(CutWindow(0, 'slide', 0.5, 0.1, {'signal': window}))

    expected, without, corrected = (
        features(plain, slide(2)),
        features(plain, through(slide(2), wavy)),
        features(other, through(slide(2), wavy)),
    )
    wrong, left = (np.abs(one.values - expected.values).max() for one in (without, corrected))
    assert left < 0.35 * wrong
    # A classifier without the correction must notice it.
    assert corrected.feature_set.startswith(f'{expected.feature_set} corrected=')


@pytest.mark.parametrize(
    ('gain', 'amplified'), [(0.5, 2.0), (2.0, 1.0)]
)  # the noise may not have changed with the gain
def test_the_correction_of_a_less_sensitive_finger_amplifies_its_noise(gain, amplified):
    correction = Correction.of({'signal': compare(found(slide(0)), found(gain * slide(1)))})
    assert correction.noise_gain('signal') == pytest.approx(amplified, rel=0.05)
    assert correction.noise_gain('other') == 1.0


def test_slides_that_prove_nothing_are_refused_with_what_to_do():
    for samples, rest, message in (
        (slide(seconds=1.8), None, 'slide for 2 s or longer'),
        (np.clip(slide(), -50.0, 50.0), None, 'the sensor is saturated; press less'),
        (slide(), slide(3), 'too little signal; see that the finger touches the plate'),
    ):
        with pytest.raises(InvalidData, match=message):
            found(samples, rest)
    assert compare(found(slide(0)[:4290]), found(slide(1))).faults == []  # 1.95 s of one that was asked for as 2 s
    with pytest.raises(InvalidData, match=r'the reference is of the sensor biotac.* and this one is tsf85'):
        compare(found(slide()), found(slide(), sensor='tsf85'))


def test_files_next_to_a_model_are_read_back_or_refused(tmp_path):
    model = tmp_path / 'cloths.npz'
    assert read_correction(model) is None
    with pytest.raises(ModelMismatch, match='there is no model'):
        read_reference(model)
    model.with_suffix('.json').write_text('{}')
    with pytest.raises(ModelMismatch, match=r'no reference is stored.*--store'):
        read_reference(model)
    reference = found(slide())
    write_reference(model, {'signal': reference}, {'speed_m_s': 0.03, 'force_n': 5})
    inputs, made = read_reference(tmp_path / 'cloths.json')
    assert compare(inputs['signal'], reference).faults == []
    assert made == {'speed_m_s': 0.03, 'force_n': 5.0}
    path = file_next_to(model, 'reference')
    for damaged in ('[1]', '{"force_n": [5]}'):
        path.write_text(f'{{"inputs": {{}}, "slide": {damaged}}}')
        with pytest.raises(ModelMismatch, match=r'cannot be used: .*; store it again by --store'):
            read_reference(model)
    correction = Correction.of({'signal': compare(reference, found(2.0 * slide(1)))})
    path = file_next_to(model, 'correction')
    path.write_text(json.dumps(correction.as_mapping()))
    assert read_correction(model).fingerprint == correction.fingerprint
    window = WindowBatch(np.zeros((100, 2)), RATE_HZ)
    with pytest.raises(InvalidData, match='is for 1 channel, and a window has 2'):
        correction.apply('signal', window)
    for damaged in ('{"signal": {}}', '[]'):
        path.write_text(damaged)
        with pytest.raises(ModelMismatch, match='remove it, and check the finger again'):
            read_correction(model)
