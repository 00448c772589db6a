"""How hard a simulated scene is, set once: the noise at which one method does as well as its paper tells."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from texture_evaluation.experiments.protocol import Protocol
from texture_evaluation.experiments.trial import of_task
from texture_simulation.scene import Scene, load_scene

LEAST_COUNT, MOST_COUNT = 1.0, 10_000.0
STEPS = 9  # halvings of four decades: to 2 %
OTHER_SLIDES = 1000  # added to the seed, so that the noise is not set on the slides that are then reported


def set_difficulty(protocol: Protocol, seed: int, tell: Callable[[float, float], None] = lambda *_: None) -> float:
    """Return the noise of the fast channels, in counts, at which the anchor's method meets the paper's figure.

    Parameters
    ----------
    protocol
        Whose scene it is.
    seed
        Of the experiment; the slides used here are others.
    tell
        Is given each noise tried and the share of test slides recognised.
    """
    anchor, scene = protocol.anchor, load_scene(protocol.scene)
    task = next(task for task in protocol.tasks if task.name == anchor.task)
    alone = replace(task, methods=tuple(method for method in task.methods if method.name == anchor.method))
    low, high = math.log(LEAST_COUNT), math.log(MOST_COUNT)
    for _ in range(STEPS):
        middle = (low + high) / 2.0
        noisy = at_noise(scene, math.exp(middle))
        _, outcome = next(of_task(protocol, alone, noisy, seed + OTHER_SLIDES, quick=False))
        tell(math.exp(middle), outcome.test.value)
        low, high = (middle, high) if outcome.test.value > anchor.test else (low, middle)
    return math.exp((low + high) / 2.0)


def at_noise(scene: Scene, fast_count: float) -> Scene:
    """Return the scene with another noise of the fast channels."""
    noise = replace(scene.effects['noise'], fast_count=fast_count)
    return replace(scene, effects={**scene.effects, 'noise': noise})
