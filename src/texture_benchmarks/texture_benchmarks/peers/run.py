"""General classifiers of time series, from packages of their own, on the vibration of later recorded slides."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from texture_benchmarks.recipes.raw_windows import try_estimator
from texture_benchmarks.recipes.run import DATA, LATER, SPLITS, VIBRATION, biotac20_settings
from texture_benchmarks.recipes.trial import LENGTH_S
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData
from texture_estimation.search.parallel import single_blas_thread

PACKAGES = 'TEXTURE_PEERS'  # environment variable: the folder of the packages of the peers
PEERS: Mapping[str, str] = {
    'MiniRocket': 'aeon.classification.convolution_based:MiniRocketClassifier',  # Dempster et al. 2021
    'MultiRocketHydra': 'aeon.classification.convolution_based:MultiRocketHydraClassifier',  # Dempster et al. 2023
    'QUANT': 'aeon.classification.interval_based:QUANTClassifier',  # Dempster et al. 2024
    'CNN': 'texture_benchmarks.peers.convolutional_network:ConvolutionalNetwork',  # Wang et al. 2017, smaller
}
NEEDED = ('aeon', 'torch')


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train the peers on slides 1-30 of each surface, and test them on the later ones.

    Raises
    ------
    InvalidData
        If their packages are missing.
    """
    with _packages(), single_blas_thread():
        missing = [name for name in NEEDED if find_spec(name) is None]
        if missing:
            raise InvalidData(f'{" and ".join(missing)} cannot be imported; `make peers` installs and runs all')
        setting = biotac20_settings(options)[VIBRATION]
        [split] = [each for each in setting.splits if each.name == LATER]
        names = ('MiniRocket',) if options.quick else PEERS
        numbers = {name: try_estimator(setting.dataset, split, PEERS[name], options.seed) for name in names}
    return BenchmarkResult(
        name='peers',
        measured=(
            'share of single windows recognised; share of slides recognised over the sliding time, by the highest mean '
            'probability, or by the votes of methods that give none; computing time of a training (s); time from '
            f'window to label (µs), by the clock of the processor. Windows of {LENGTH_S} s that do not overlap'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz',
        split=f'{LATER}: {SPLITS[LATER]}',
        numbers=numbers,
    )


@contextmanager
def _packages() -> Iterator[None]:
    """Let the packages of the peers be found, behind those of the suite, which stay as they are."""
    before, folder = list(sys.path), os.environ.get(PACKAGES)
    if folder:
        sys.path.append(str(Path(folder)))
    try:
        yield
    finally:
        sys.path[:] = before
