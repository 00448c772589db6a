from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from texture_benchmarks import charts


@pytest.mark.parametrize('n_labels', [1, 3, 40])
def test_a_confusion_chart_is_drawn_for_few_and_many_labels(n_labels: int, tmp_path: Path) -> None:
    labels = [f's{k}' for k in range(n_labels)]
    drawn = charts.confusion_chart(labels, np.eye(n_labels, dtype=int), 'title', tmp_path / 'made' / 'c.png')
    assert matplotlib.image.imread(drawn).std() > 0


def test_the_evidence_chart_is_drawn_without_a_display(tmp_path: Path) -> None:
    line = (np.array([0.5, 1.0]), np.array([0.8, 0.9]))
    drawn = charts.evidence_chart({f'm{k}': line for k in range(9)}, 'title', tmp_path / 'e.png')
    assert matplotlib.image.imread(drawn).std() > 0
