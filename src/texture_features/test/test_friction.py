"""Tangential over normal force: from the states of an exploration to a feature of each window."""

import math

import numpy as np
import pytest

from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_features.feature_set import FeatureSet
from texture_features.windows import WindowParams, cut_recording

RATE_HZ, STEP_NS = 100.0, 20_000_000
RECIPE = {'windows': {'length_s': 0.5, 'hop_s': 0.5}, 'inputs': {'signal': {'features': ['friction', 'mean']}}}


def states(tangential_n, seconds=1.0):
    """Slide under 2 N; each state says how much the surface drags at its time."""
    for number in range(round(seconds * 1e9 / STEP_NS)):
        stamp_ns = number * STEP_NS
        yield ExplorationState(
            stamp_ns,
            'a',
            'linear_slide',
            Phase.SLIDE,
            0.02,
            0.05,
            2.0,
            tangential_force_n=tangential_n(stamp_ns * 1e-9),
        )


def friction_of(tangential_n, stretch_to_m_s=0.0):
    inputs = {'signal': {**RECIPE['inputs']['signal'], 'stretch_to_m_s': stretch_to_m_s}}
    features = FeatureSet.from_mapping({**RECIPE, 'inputs': inputs})
    batch = TactileSignal(0, 'finger', ('a',), (), RATE_HZ, 0, np.zeros((120, 1), dtype=np.float32))
    events = list(cut_recording({'signal': [batch]}, states(tangential_n), WindowParams(0.5, 0.5)))
    one_by_one = [features.extract(event) for event in events]
    together = features.extract_many(events)
    for single, several in zip(one_by_one, together, strict=True):
        np.testing.assert_array_equal(single.values, several.values)
    return [float(vector.values[0]) for vector in together if not vector.last]


@pytest.mark.parametrize('coefficient', [0.1, 0.6, 1.2])
@pytest.mark.parametrize('stretch_to_m_s', [0.0, 0.1])
def test_the_feature_is_the_coefficient_of_coulomb_friction_at_any_stretch(coefficient, stretch_to_m_s):
    assert friction_of(lambda _time_s: 2.0 * coefficient, stretch_to_m_s) == pytest.approx([coefficient] * 2)


def test_each_window_has_the_mean_of_its_own_time():
    assert friction_of(lambda time_s: 0.4 if time_s < 0.4999 else 1.0) == pytest.approx([0.2, 0.5])


def test_states_without_direction_are_left_out_of_the_mean():
    assert friction_of(lambda time_s: math.nan if time_s < 0.1 else 0.8) == pytest.approx([0.4, 0.4])


def test_an_arm_that_does_not_measure_it_gives_no_number():
    assert np.isnan(friction_of(lambda _time_s: math.nan)).all()
