"""What friction, tangential over normal force, adds to the features of Roberge et al.: their further question."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texture_benchmarks.papers.claim_checks import higher
from texture_benchmarks.papers.experiment import Experiment, ExperimentResult
from texture_benchmarks.papers.method_result import MethodResult
from texture_benchmarks.papers.protocol import Method, RecognitionTask, Visits, halves
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.papers.report import figures_of, finding_as_json
from texture_benchmarks.papers.simulated_trials import Slides, gather
from texture_benchmarks.papers.trial import evaluate_method, recipe_of, reduced
from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_simulation.frictions import sliding_coefficient
from texture_simulation.scene import Scene, load_scene
from texture_simulation.simulated_slide import SimulatedSlide

SCENE, TASK, RECIPES = 'sticky', 'six sheets', ('ets-linear-svm', 'ets-linear-ann')
SPEEDS_M_S, FORCES_N, SLIDE_S = (0.10, 0.15, 0.20), (1.0, 2.5, 5.0), 0.5
COUNT, QUICK_COUNT, SPLITS = 10, 18, 5
# Standard deviations of each force of the wrench, constant within a slide, as weight and zero of a sensor are: assumed.
ERRORS_N = (0.0, 0.1, 0.3, 1.0)
LEAST_N = 0.1  # normal force by which is divided
VISITS = tuple(
    Visits(f'{speed:.2f} m/s, {force:g} N', COUNT, SimulatedSlide(speed, force, SLIDE_S))
    for speed in SPEEDS_M_S
    for force in FORCES_N
)


def run(experiment: Experiment) -> ExperimentResult:
    """Recognise sheets that differ in friction without it, and with it as a wrench with errors gives it.

    Raises
    ------
    InvalidParameter
        If a search is asked for.
    """
    if experiment.tune:
        raise InvalidParameter("experiment 'friction' has nothing to tune; leave --tune out")
    scene = load_scene(SCENE)
    task = RecognitionTask(TASK, VISITS, ())
    slides = gather(scene, reduced(task, QUICK_COUNT) if experiment.quick else task, experiment.seed, slow=False)
    rng = np.random.default_rng(experiment.seed)
    trained_on = halves(experiment.splits or SPLITS)(slides.codes, slides.conditions, rng, experiment.quick)
    found: dict[str, MethodResult] = {}
    for name in RECIPES:
        recipe = recipe_of(Method(name))
        found[name] = evaluate_method(recipe, slides, trained_on)
        for error_n in ERRORS_N:
            beside = measured_friction(scene, slides, error_n, np.random.default_rng([experiment.seed, 7]))
            found[_with(name, error_n)] = evaluate_method(recipe, slides, trained_on, beside=beside)
    checked = [
        higher(f'friction lifts {name}, errors of {error_n:g} N', found[_with(name, error_n)], found[name])
        for name in RECIPES
        for error_n in ERRORS_N
    ]
    return ExperimentResult(
        name='friction',
        measured='slides recognised without friction and with it; intervals of 95 % over slides',
        data=f"simulated: scene '{scene.name}' ({scene.about}); {len(slides.codes)} slides; wrench of assumed errors",
        split=f'{len(trained_on)} random halves of each sheet',
        numbers={
            'seed': experiment.seed,
            'recipes': {name: digest_of(name) for name in RECIPES},
            'tasks': {TASK: {name: figures_of(Method(name), outcome) for name, outcome in found.items()}},
            'findings': [finding_as_json(finding) for finding in checked],
        },
        lines=tuple(_lines(found)),
    )


def measured_friction(scene: Scene, slides: Slides, error_n: float, rng: np.random.Generator) -> Array:
    """Return tangential over normal force of each slide, (n_slides, 1), of steady sliding and a wrench with errors.

    Parameters
    ----------
    scene
        Gives the friction of each sheet.
    slides
        With speed and force of each.
    error_n
        Standard deviation of the error of each force, N.
    rng
        Draws the errors.

    Returns
    -------
    (n_slides, 1)
    """
    normal_n, speed_m_s = slides.views[0].force_n, slides.views[0].speed_m_s
    frictions = [scene.surfaces[name].friction for name in slides.surfaces]
    coefficients = np.array([sliding_coefficient(friction, speed_m_s) for friction in frictions])
    tangential_n = coefficients[slides.codes, np.arange(len(slides.codes))] * normal_n
    wrong_n = error_n * rng.standard_normal((2, len(normal_n)))
    ratio: Array = (tangential_n + wrong_n[0]) / np.maximum(normal_n + wrong_n[1], LEAST_N)
    return ratio[:, None]


def _with(name: str, error_n: float) -> str:
    return f'{name}, with friction, errors of {error_n:g} N'


def _lines(found: Mapping[str, MethodResult]) -> list[str]:
    return [f'{name:52}{100 * outcome.test.value:6.1f} % of the tested slides' for name, outcome in found.items()]
