# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What several tests of the whole suite share: simulated slides and a model of them, made once for all of a run."""

from __future__ import annotations

import fcntl
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from texture_bringup.command import main
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


@pytest.fixture
def asked() -> Callable[..., int]:
    """Return a function: the exit code of a command, while the nodes of a graph answer it."""

    def asked(graph: Any, *arguments: str) -> int:
        codes: list[int] = []
        asking = threading.Thread(target=lambda: codes.append(main(list(arguments))))
        asking.start()
        graph.until(lambda: bool(codes))
        asking.join()
        return codes[0]

    return asked
