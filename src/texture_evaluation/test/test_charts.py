from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from texture_core.estimates import TextureEstimate
from texture_evaluation import charts
from texture_evaluation.slide_overview_chart import SlideOverview, picture

LABELS = ('cork', 'felt', 'linen')
TABLE = np.array([[9, 1, 0], [2, 8, 0], [0, 0, 0]])


def overview() -> SlideOverview:
    estimates = [TextureEstimate(0, 'e', 'cork', True, 0.8, LABELS, (0.8, 0.1, 0.1), k, 0.5 * k) for k in (1, 2, 3)]
    tone = np.sin(2 * np.pi * 100 * np.arange(2000) / 1000)
    return SlideOverview('simulated', 'cork', tone, 1000.0, 'count', estimates, LABELS, TABLE)


@pytest.mark.parametrize('n_labels', [1, 3, 40])
def test_a_confusion_chart_is_drawn_for_few_and_many_labels(n_labels: int, tmp_path: Path) -> None:
    labels = [f's{k}' for k in range(n_labels)]
    drawn = charts.confusion_chart(labels, np.eye(n_labels, dtype=int), 'title', tmp_path / 'made' / 'c.png')
    assert matplotlib.image.imread(drawn).std() > 0


def test_the_picture_and_the_evidence_chart_are_drawn_without_a_display(tmp_path: Path) -> None:
    line = (np.array([0.5, 1.0]), np.array([0.8, 0.9]))
    for drawn in (
        picture(overview(), tmp_path / 'p.png'),
        charts.evidence_chart({f'm{k}': line for k in range(9)}, 'title', tmp_path / 'e.png'),
    ):
        assert matplotlib.image.imread(drawn).std() > 0
