# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import re

import numpy as np

from texture_core.types import Rejection, TextureEstimate
from texture_exploration.exploration import may_stop, new_id


def test_an_id_tells_time_and_number_and_differs_between_two_nodes_that_begin_at_once():
    names = [new_id(1_500_000_000, 2, np.random.default_rng(seed)) for seed in (1, 2)]
    assert all(re.fullmatch(r'19700101T000001-002-[0-9a-f]{4}', name) for name in names)
    assert names[0] != names[1]


def texture(**values):
    return TextureEstimate(
        **{'stamp_ns': 1, 'exploration_id': 'one', 'label': 'cork', 'rejection': Rejection.NONE, **values}
    )


def test_a_known_texture_that_is_decided_ends_the_slide():
    assert may_stop(texture(confidence=0.95, decided=True))
    assert not may_stop(texture(confidence=0.95))
    assert not may_stop(texture(confidence=0.95, decided=True, rejection=Rejection.NOVEL))
    assert not may_stop(texture(decided=True))  # confidence unknown
