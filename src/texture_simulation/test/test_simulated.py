# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np

from texture_core.types import lost_samples
from texture_recordings.bags import read_bag
from texture_recordings.dataset import find_slides
from texture_simulation.offline import SlidePlan, write_simulated


def test_each_surface_has_its_slides_without_a_loss(tmp_path: Path) -> None:
    plan = SlidePlan(slides=2, slide_s=0.5)
    bags = write_simulated(tmp_path, plan, np.random.default_rng(0), surfaces=('leather', 'glass'))
    assert [(s.surface, s.number) for s in find_slides(bags)] == [
        ('leather', 1),
        ('leather', 2),
        ('glass', 1),
        ('glass', 2),
    ]
    for topic in ('signal', 'signal_static'):
        assert lost_samples([signal for _, _, signal in read_bag(bags[0], (topic,))]) == 0
