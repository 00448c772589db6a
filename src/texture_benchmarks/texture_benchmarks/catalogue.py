"""Benchmarks by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from texture_benchmarks.ablation import run as ablation
from texture_benchmarks.biotac20 import run as biotac20
from texture_benchmarks.clock import run as clock
from texture_benchmarks.decisions import run as decisions
from texture_benchmarks.features import run as features
from texture_benchmarks.frontier import run as frontier
from texture_benchmarks.latency import hand
from texture_benchmarks.latency import run as latency
from texture_benchmarks.learning import run as learning
from texture_benchmarks.load import run as load
from texture_benchmarks.motion import run as motion
from texture_benchmarks.next_motion import recorded as next_motion_recorded
from texture_benchmarks.next_motion import run as next_motion
from texture_benchmarks.onset import run as onset
from texture_benchmarks.optimise import pairs_run as optimise_pairs
from texture_benchmarks.optimise import run as optimise
from texture_benchmarks.overview import run as overview
from texture_benchmarks.peers import run as peers
from texture_benchmarks.recipes import run as recipes
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.robustness import run as robustness
from texture_benchmarks.roughness import run as roughness
from texture_benchmarks.scale import run as scale
from texture_benchmarks.scenes import run as scenes
from texture_benchmarks.segmentation import run as segmentation
from texture_benchmarks.sensors import run as sensors
from texture_benchmarks.speed_force import run as speed_force
from texture_benchmarks.stick_slip import run as stick_slip
from texture_benchmarks.trust import run as trust
from texture_core.catalogue import find

BENCHMARKS: Mapping[str, Callable[[BenchmarkOptions], BenchmarkResult]] = {
    'latency': latency.run,  # from window to estimate, in one process and through the graph; computing time
    'hand': hand.run,  # five BioTacs at once through the running nodes: latency and computing time
    'biotac20': biotac20.run,  # 20 recorded materials, tested on slides of a later time
    'recipes': recipes.run,  # all recipes on recorded slides: accuracy, training time, latency
    'recipes_later': recipes.run_later,  # the same on the vibration of slides of a later time alone
    'peers': peers.run,  # general classifiers of time series on the same later slides; in packages of their own
    'frontier': frontier.run,  # accuracy by window length and sliding time, what trainings cost by their size
    'onset': onset.run,  # recipes with a discriminant of their own for the first window, on later slides
    'scale': scale.run,  # trainings and windows with up to 1000 textures and 100 000 windows, drawn features
    'ablation': ablation.run,  # which features, numbers, units and channels contribute their time, recorded
    'decisions': decisions.run,  # early decisions, calibration, candidates and unknown surfaces, recorded
    'trust': trust.run,  # slides wrong and known under disturbances, early and at the end
    'speed_force': speed_force.run,  # speeds, forces and directions that were not in the training set, recorded
    'roughness': roughness.run,  # from window to grade
    'robustness': robustness.run,  # where recipes break down as noise, wear, losses or speed errors grow
    'optimise': optimise.run,  # genetic searches of the papers' size, linear experiment: time, convergence
    'optimise_large': optimise.run_large,  # all of them, and the fronts of accuracy and computing; not in `all`
    'optimise_pairs': optimise_pairs.run,  # what a search for each pair of textures chooses; not in `all`
    'learning': learning.run,  # trained slide by slide against trained again on the same slides
    'clock': clock.run,  # stamps in spite of late arrivals and drift
    'sensors': sensors.run,  # every sensor's line with faults
    'load': load.run,  # what sensor nodes cost and lose, alone, together and at high rates
    'features': features.run,  # cost of each feature, one window at a time and many at once
    'segmentation': segmentation.run,  # start and end of sliding, found from the signals alone
    'motion': motion.run,  # force, speed and circle by robot and surface; where force control is stable
    'next_motion': next_motion.run,  # slides needed with motions chosen for what they tell, simulated
    'next_motion_recorded': next_motion_recorded.run,  # the same among recorded speeds and forces
    'scenes': scenes.run,  # cost of simulated slides and devices; what each term of a scene contributes
    'stick_slip': stick_slip.run,  # cost, error and longest step of simulated friction
    'overview': overview.run,  # accuracy against time in one picture, from the stored figures of others
}


def run_benchmark(name: str, options: BenchmarkOptions) -> tuple[BenchmarkResult, Path]:
    """Run one benchmark; return its result and the JSON file, beside which its charts lie.

    Raises
    ------
    TextureError
        If there is no such benchmark or its data is missing.
    """
    result = find(BENCHMARKS, name, 'benchmark')(options)
    return result, result.write(options.out)
