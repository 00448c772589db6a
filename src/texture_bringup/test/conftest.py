# SPDX-License-Identifier: Apache-2.0
"""What several tests of the whole suite share: simulated slides and a model of them, made once for all of a run."""

from __future__ import annotations

import fcntl
from pathlib import Path

import numpy as np
import pytest

from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

TWO = ('glass', 'ridge_2mm_deep')


@pytest.fixture(scope='session')
def two_surfaces(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Return a folder with `bags/` of four simulated slides over each of two surfaces, and `model.npz` of them."""
    own = tmp_path_factory.getbasetemp()
    # The workers of a run have one parent folder: who comes first makes it for all.
    folder = (own.parent if hasattr(request.config, 'workerinput') else own) / 'two_surfaces'
    folder.mkdir(exist_ok=True)
    with (folder / 'lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / 'finished').exists():
            plan = SlidePlan(slides=4, speed_m_s=0.05, force_n=1.0, slide_s=1.0)
            bags = write_simulated(folder / 'bags', plan, np.random.default_rng(0), surfaces=TWO)
            train_from_bags('default', bags, out=folder / 'model')
            (folder / 'finished').touch()
    return folder
