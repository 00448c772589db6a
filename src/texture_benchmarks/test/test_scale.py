import os
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.scale import DrawnSize, FeatureSpread
from texture_benchmarks.study import BenchmarkOptions
from texture_features.examples import LabelledFeatures

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')
recorded = pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
DEVIATIONS = {'textures': 5.0, 'slides': 2.0, 'windows': 1.0}


def test_drawn_features_vary_as_much_among_textures_slides_and_windows_as_the_recorded_ones() -> None:
    rng = np.random.default_rng(0)
    textures = DEVIATIONS['textures'] * rng.standard_normal((60, 1, 1, 3))
    slides = textures + DEVIATIONS['slides'] * rng.standard_normal((60, 20, 1, 3))
    values = slides + DEVIATIONS['windows'] * rng.standard_normal((60, 20, 10, 3))
    labels = np.repeat([f'c{number:02d}' for number in range(60)], 200)
    groups = np.char.add(labels, np.tile(np.repeat([f'/{number}' for number in range(20)], 10), 60))
    names = ('signal/mean', 'signal/rms', 'signal/peak')
    spread = FeatureSpread.of(LabelledFeatures(values.reshape(-1, 3), labels, groups, names, 'a1', 0.5, 0.1))
    centres = spread.textures(2000, rng)
    drawn = spread.slides(np.zeros((1, 3)), DrawnSize(1, slides=2000, windows=10), rng).values.reshape(2000, 10, 3)
    assert centres.std(axis=0) == pytest.approx([DEVIATIONS['textures']] * 3, rel=0.2)  # of 60 textures: 9 % each
    assert drawn.mean(axis=1).std(axis=0) == pytest.approx([DEVIATIONS['slides']] * 3, rel=0.1)
    # The mean of ten windows takes a tenth of their variance: once when it is measured, once when it is drawn.
    about_their_mean = (drawn - drawn.mean(axis=1, keepdims=True)).std()
    assert about_their_mean == pytest.approx(0.9 * DEVIATIONS['windows'], rel=0.02)


@pytest.mark.benchmark
@recorded
def test_a_small_training_on_drawn_features_recognises_some_and_reports_what_it_took(tmp_path: Path) -> None:
    result, _ = run_benchmark('scale', BenchmarkOptions(out=tmp_path, quick=True, data=DATA))
    [few] = result.numbers['textures, default']
    assert few['training_windows'] == 6 * 5 * 5
    assert few['slide_accuracy'] > 0.4  # chance is a sixth
    assert few['train_s'] > 0
    assert few['memory_of_the_process_mib'] > few['memory_beyond_examples_mib'] >= 0
    assert [chart.name for chart in result.charts] == ['scale.png']
