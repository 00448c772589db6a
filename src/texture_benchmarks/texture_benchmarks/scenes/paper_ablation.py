"""What each effect of a scene contributes to the method of its paper: the experiment with it, and without."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from texture_benchmarks.papers import ets_linear, jamali
from texture_benchmarks.papers.protocol import PaperProtocol, folds, halves
from texture_benchmarks.papers.trial import of_task
from texture_benchmarks.scenes.touch_protocols import TOUCH_PROTOCOLS, completed, variants
from texture_benchmarks.scenes.trial import Ablation, difference
from texture_simulation.scene import Scene, load_scene


@dataclass(frozen=True)
class Paper:
    """A paper's experiment, its slides divided less often than there, and the method by which its scene was set."""

    protocol: PaperProtocol
    method: str


# Scenes in which the quick learner is too good, or too bad, to see all that the paper's method sees.
PAPERS: Mapping[str, Paper] = {
    'ets_linear': Paper(replace(ets_linear.PROTOCOL, divide=halves(4)), ets_linear.SVM),
    'jamali': Paper(replace(jamali.PROTOCOL, divide=folds(5, 1)), jamali.FIVE),
}


def with_paper(ablation: Ablation, repeats: int, seed: int, *, quick: bool = False) -> Ablation:
    """Return the same with the change of accuracy of the paper's method, if there is one, without each effect.

    Parameters
    ----------
    ablation
        Effects of the terms.
    repeats
        Number of repetitions.
    seed
        Of everything random.
    quick
        Whether fewer slides will do.

    Returns
    -------
    Ablation
    """
    paper = PAPERS.get(ablation.scene)
    if not paper:
        return ablation
    touch_protocol = TOUCH_PROTOCOLS[ablation.scene]
    scene = completed(load_scene(ablation.scene), touch_protocol)
    worlds = {term: world for term, world in variants(scene, touch_protocol).items() if term in scene.effects}
    tried = (scene, *worlds.values())
    right = np.array([[_right(paper, world, seed + n, quick=quick) for world in tried] for n in range(repeats)])
    changes = {term: difference(column) for term, column in zip(worlds, (right[:, 1:] - right[:, :1]).T, strict=True)}
    term_effects = [replace(term_effect, paper=changes.get(term_effect.term)) for term_effect in ablation.term_effects]
    return replace(ablation, term_effects=term_effects, paper=float(right[:, 0].mean()))


def _right(paper: Paper, scene: Scene, seed: int, *, quick: bool) -> float:
    """Return the share of the test slides that are recognised."""
    [task] = paper.protocol.tasks
    task = replace(task, methods=tuple(method for method in task.methods if method.name == paper.method))
    [(_, outcome)] = of_task(paper.protocol, task, scene, seed, quick=quick)
    return outcome.test.value
