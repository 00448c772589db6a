# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest

from texture_simulation.offline import SlidePlan, write_simulated

SURFACES = ('glass', 'leather', 'ridge_2mm_deep')


@pytest.fixture(scope='session')
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of bags: six slides of 1.2 s over each of three simulated surfaces."""
    folder = tmp_path_factory.mktemp('simulated')
    write_simulated(folder, SlidePlan(slides=6, slide_s=1.2), np.random.default_rng(5), surfaces=SURFACES)
    return folder
