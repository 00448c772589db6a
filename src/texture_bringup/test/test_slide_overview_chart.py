# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from texture_bringup.demo import GrowingEvidence, SlideOverview, picture

pytestmark = pytest.mark.ros

LABELS = ('cork', 'felt', 'linen')
TABLE = np.array([[9, 1, 0], [2, 8, 0], [0, 0, 0]])


def overview() -> SlideOverview:
    log_odds = np.outer([1.0, 2.0, 3.0], [0.0, 1.5, 2.5])
    evidence = GrowingEvidence('cork', np.array([0.5, 0.6, 0.7]), LABELS, log_odds, 0.8)
    tone = np.sin(2 * np.pi * 100 * np.arange(2000) / 1000)
    return SlideOverview('simulated', 'cork', tone, 1000.0, 'count', evidence, LABELS, TABLE)


def test_the_picture_is_drawn_without_a_display(tmp_path: Path) -> None:
    assert matplotlib.image.imread(picture(overview(), tmp_path / 'p.png')).std() > 0
