from pathlib import Path

import matplotlib.image
import numpy as np

from texture_bringup.demo.slide_overview_chart import SlideOverview, picture
from texture_core.estimates import TextureEstimate

LABELS = ('cork', 'felt', 'linen')
TABLE = np.array([[9, 1, 0], [2, 8, 0], [0, 0, 0]])


def overview() -> SlideOverview:
    estimates = [TextureEstimate(0, 'e', 'cork', True, 0.8, LABELS, (0.8, 0.1, 0.1), k, 0.5 * k) for k in (1, 2, 3)]
    tone = np.sin(2 * np.pi * 100 * np.arange(2000) / 1000)
    return SlideOverview('simulated', 'cork', tone, 1000.0, 'count', estimates, LABELS, TABLE)


def test_the_picture_is_drawn_without_a_display(tmp_path: Path) -> None:
    assert matplotlib.image.imread(picture(overview(), tmp_path / 'p.png')).std() > 0
