# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What several tests of the whole suite share: simulated slides and a model of them, and a launched robot."""

from __future__ import annotations

import fcntl
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from texture_bringup.command import main
from texture_bringup.launcher import ChildLauncher
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

TWO = ('glass', 'ridge_2mm_deep')
# A busy machine may hold up an emulated robot for longer than a real one is allowed to be silent.
PATIENT = {'state_timeout_s': 2.0, 'signal_timeout_s': 3.0, 'estimate_timeout_s': 10.0}
START_S = 90.0
LISTENED = ('exploration', 'features')  # topics to which the nodes that estimate subscribe


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


class Launched(ChildLauncher):
    """A launched robot."""

    ending: ExitStack

    def operator(self, namespace: str = '', *, senses: bool = True, listened: tuple[str, ...] = LISTENED) -> Any:
        """Return a client of the nodes of a namespace, once they explore, estimate and, if it senses, measure."""
        from rclpy.task import Future  # noqa: PLC0415  # pure tests have no ROS

        from texture_bringup.operator import DISCOVERY_S, Operator  # noqa: PLC0415

        operator = self.ending.enter_context(Operator(namespace, guard=self.check))
        operator.wait_for_explorer(START_S)
        if senses:
            operator.wait_for_signal(START_S)
        count, missing = operator._node.count_subscribers, f'no node subscribes to one of {", ".join(listened)}'
        operator.wait_until(lambda: all(count(topic) for topic in listened), START_S, missing)
        operator._complete(Future(), DISCOVERY_S)  # the others discover them, too
        return operator


@contextmanager
def running(
    file: str, domain_id: int, folder: Path, params: dict[str, Any] | None = None, **arguments: Any
) -> Iterator[Launched]:
    """Launch a robot with a patient explorer; the commands of the test find its nodes in this ROS domain."""
    patient = folder / 'patient.yaml'
    patient.write_text(yaml.safe_dump({'/**': {'ros__parameters': {**PATIENT, **(params or {})}}}))
    two = {'left_params': patient, 'right_params': patient}
    given = (two if file == 'two_arms' else {'devices': folder, 'explorer_params': patient}) | arguments
    with pytest.MonkeyPatch.context() as patch, ExitStack() as ending:
        for name, value in {'ROS_DOMAIN_ID': str(domain_id), 'ROS_LOG_DIR': str(folder)}.items():
            patch.setenv(name, value)
        launcher = ending.enter_context(Launched(file, given, dict(os.environ), folder / 'nodes.log'))
        launcher.ending = ending
        yield launcher


@pytest.fixture(scope='session')
def launched() -> Callable[..., AbstractContextManager[Launched]]:
    """Return the function that launches a robot for a `with` block."""
    return running


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
