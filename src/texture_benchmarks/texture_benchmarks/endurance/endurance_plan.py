"""What an endurance run does, and the launch file and model it runs with."""

from __future__ import annotations

import os
import socket
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_bringup.demo.isolation import Isolation
from texture_evaluation.train import train_from_bags
from texture_launch.child import ChildLauncher
from texture_simulation.simulated_bags import SlidePlan, write_simulated

SCENE, SURFACE = 'twelve_textures', 'glass'
SLIDES = SlidePlan(slides=5, speed_m_s=0.08, force_n=1.5, slide_s=1.0)


@dataclass(frozen=True)
class EndurancePlan:
    """What is run.

    Parameters
    ----------
    duration_s
        How long.
    quiet_s
        Mean time between two faults.
    seed
        Of orders, faults and the bench.
    model
        That the classifier classifies by; None: one is trained on simulated slides first.
    settle_s
        Time for the nodes to find each other, before anything is asked of them.
    """

    duration_s: float = 3600.0
    quiet_s: float = 20.0
    seed: int = 0
    model: Path | None = None
    settle_s: float = 10.0


def launched_nodes(isolation: Isolation, folder: Path, plan: EndurancePlan, log: Path) -> ChildLauncher:
    """Return the launch of the emulator with a model; use it in a `with` block.

    Parameters
    ----------
    isolation
        Domain, ports and environment of the run.
    folder
        Where logs of ROS lie.
    plan
        With its model.
    log
        File of what the nodes print.

    Returns
    -------
    ChildLauncher
        Not yet started.
    """
    assert plan.model is not None
    card = plan.model.with_suffix('.json').resolve()
    arguments = {
        'device': isolation.device,
        'finger_port': isolation.finger_port,
        'scene': SCENE,
        'seed': plan.seed,
        'model': card,
        'recipe': card,
        'watch_signal': 'true',
        'dashboard': 'true',
        'dashboard_port': _free_tcp_port(),
    }
    environment = isolation.environment({**os.environ, 'ROS_LOG_DIR': str(folder / 'ros_log')})
    return ChildLauncher('emulator', arguments, environment, log, together=False)


def trained_model(folder: Path, seed: int) -> Path:
    """Return the path of a model that is trained on simulated slides in the folder."""
    bags = write_simulated(folder / 'slides', SLIDES, np.random.default_rng(seed), SCENE)
    train_from_bags('default', bags, out=folder / 'model')
    return folder / 'model'


def _free_tcp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
