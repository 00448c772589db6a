"""Placeholder while being written."""

from texture_evaluation.experiments.experiment import Experiment, ExperimentResult


def run(experiment: Experiment) -> ExperimentResult:
    raise NotImplementedError
