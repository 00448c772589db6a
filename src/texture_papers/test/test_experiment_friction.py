"""What friction adds to the features of a paper, on sheets that differ in it."""

from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_papers.catalogue import run_experiment
from texture_papers.protocol import Experiment, RecognitionTask, gather, reduced
from texture_papers.roberge_experiment import FRICTION_SCENE, FRICTION_TASK, FRICTION_VISITS, measured_friction
from texture_simulation.scene import load_scene


def test_friction_without_errors_is_the_stribeck_curve_of_each_sheet_at_its_speed() -> None:
    scene = load_scene(FRICTION_SCENE)
    task = RecognitionTask(FRICTION_TASK, FRICTION_VISITS, (), surfaces=('dusty_plastic', 'oiled_plastic'))
    slides = gather(scene, reduced(task, 9), seed=0, slow=False)
    measured = measured_friction(scene, slides, 0.0, np.random.default_rng(0))[:, 0]
    speed = slides.views[0].speed_m_s
    # kinetic + (static - kinetic) exp(-(v / stribeck)²) + viscous v, by the numbers of the scene
    dusty = 0.3 + 0.05 * np.exp(-((speed / 0.05) ** 2))
    oiled = 0.05 + 0.05 * np.exp(-((speed / 0.02) ** 2)) + 0.2 * speed
    np.testing.assert_allclose(measured, np.where(slides.codes == 0, dusty, oiled), rtol=1e-9)


def test_a_small_normal_force_makes_errors_of_the_wrench_large() -> None:
    scene = load_scene(FRICTION_SCENE)
    slides = gather(scene, reduced(RecognitionTask(FRICTION_TASK, FRICTION_VISITS, ()), 18), seed=0, slow=False)
    exact = measured_friction(scene, slides, 0.0, np.random.default_rng(0))[:, 0]
    wrong = np.abs(measured_friction(scene, slides, 0.1, np.random.default_rng(0))[:, 0] - exact)
    force = slides.views[0].force_n
    assert np.median(wrong[force == 1.0]) > 2.0 * np.median(wrong[force == 5.0])


@pytest.mark.benchmark
def test_the_experiment_measures_friction_without_errors_as_a_gain(tmp_path: Path) -> None:
    result, path = run_experiment('friction', Experiment(tmp_path, quick=True))
    assert path.is_file()
    exact = next(one for one in result.numbers['findings'] if one['claim'].endswith('ets-linear-svm, errors of 0 N'))
    assert exact['interval'][0] > 0.1
    with pytest.raises(InvalidParameter, match='has nothing to tune'):
        run_experiment('friction', Experiment(tmp_path, quick=True, tune=True))
