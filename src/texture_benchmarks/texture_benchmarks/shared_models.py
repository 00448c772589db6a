"""Models that several benchmarks of one run need, trained once: a training with augmentation takes minutes."""

from __future__ import annotations

from collections.abc import Callable

from texture_benchmarks.result import BenchmarkOptions
from texture_core.errors import ModelMismatch
from texture_estimation.model import TextureModel, load_model


def trained_once(options: BenchmarkOptions, name: str, train: Callable[[], TextureModel]) -> TextureModel:
    """Return a model that another benchmark of the same run has stored, or else train and store it.

    Parameters
    ----------
    options
        Models lie beside the data sets that the run has imported; without these, and in quick runs, nothing is shared.
    name
        Of the model: its recipe and the slides that it is trained on.
    train
        Returns the model.

    Returns
    -------
    TextureModel
    """
    if options.bags is None or options.quick:
        return train()
    path = options.bags / f'{name}.model'
    try:
        return load_model(path)
    except ModelMismatch:  # it is missing, or another process is writing it
        model = train()
        model.save(path)
        return model
