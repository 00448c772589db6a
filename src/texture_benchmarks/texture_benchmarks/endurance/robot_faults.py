"""Which faults are injected into the emulated robots, when and how strongly."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle

import numpy as np

from texture_core.exploration import ExplorationRequest

UR, HAND, RAILS, SIMULATED_ARM = 'emulated UR', 'emulated hand', 'emulated rails', 'simulated arm'
RIGS = (UR, HAND, RAILS, SIMULATED_ARM)
NO_FAULT = 'none'
AT_START, BEFORE, IN_SLIDE = 'before the explorer starts', 'before the exploration', 'in the slide'
EXITS = ('SIGINT', 'SIGTERM', 'SIGKILL')
EXPLORATIONS_PER_SESSION = 4  # with a fault each; those after a fault come on top
DROP_M = 0.012
START_FAULT_SHARE = 0.5  # of the sessions begin with a fault
LATEST_SHARE = 0.7  # of a slide: a fault that comes later may miss it


@dataclass(frozen=True)
class RobotFault:
    """A kind of fault of a robot.

    Parameters
    ----------
    action
        What the rig does, see `texture_benchmarks.endurance.robot_rigs`.
    when
        'before the explorer starts', 'before the exploration' or 'in the slide'.
    low, high
        Range of its strength: seconds, or metres of a drop.
    weight
        How often it is drawn, compared with the others.
    surface
        Parameters of the surface under the simulated arm.
    kills
        Whether the explorer does not survive it.
    """

    action: str
    when: str
    low: float = 0.0
    high: float = 0.0
    weight: float = 1.0
    surface: Mapping[str, float] = field(default_factory=dict)
    kills: bool = False


NONE = RobotFault('none', BEFORE, weight=0.5)
KILLED = RobotFault('kill', IN_SLIDE, weight=0.5, kills=True)
ROBOT_FAULTS: Mapping[str, Mapping[str, RobotFault]] = {
    UR: {
        NO_FAULT: NONE,
        'command gap': RobotFault('freeze', IN_SLIDE, 0.25, 1.0, weight=2.0),
        'watchdog': RobotFault('freeze worker', IN_SLIDE, 0.15, 0.6),
        'protective stop': RobotFault('protective stop', IN_SLIDE, weight=2.0),
        'slow acknowledgements': RobotFault('slow', BEFORE, 0.15, 0.5, weight=2.0),
        'surface lost': RobotFault('drop', IN_SLIDE, DROP_M, DROP_M, weight=2.0),
        'another program at connect': RobotFault('another program', AT_START),
        'explorer killed': KILLED,
    },
    HAND: {
        NO_FAULT: NONE,
        'overload latched': RobotFault('overload', IN_SLIDE, weight=2.0),
        'overload at connect': RobotFault('overload', AT_START),
        'force goal is NaN': RobotFault('NaN force', IN_SLIDE),
        'exception in the bus thread': RobotFault('exception', IN_SLIDE, weight=1.5),
        'cable pulled out': RobotFault('unplug', IN_SLIDE, 0.2, 1.5),
        'surface lost': RobotFault('drop', IN_SLIDE, weight=2.0),
        'explorer killed': KILLED,
    },
    RAILS: {
        NO_FAULT: NONE,
        'cable pulled out': RobotFault('unplug', IN_SLIDE, 0.2, 1.5),
        'silence': RobotFault('silence', IN_SLIDE, 1.2, 2.5),
        'something in the way': RobotFault('block', IN_SLIDE),
        'surface lost': RobotFault('drop', IN_SLIDE, DROP_M, DROP_M),
        'explorer killed': KILLED,
    },
    SIMULATED_ARM: {
        NO_FAULT: NONE,
        'command gap': RobotFault('freeze', IN_SLIDE, 0.1, 1.0, weight=0.5),
        'step of 12 mm': RobotFault('surface', AT_START, surface={'step_m': -DROP_M}),
        'edge': RobotFault('surface', AT_START, surface={'edge_m': 0.03}),
        'explorer killed': KILLED,
    },
}


@dataclass(frozen=True)
class PlannedRobotFault:
    """A fault with its strength; `at_share` is the share of the planned slide after which it is injected."""

    name: str
    strength: float = 0.0
    at_share: float = 0.0


@dataclass(frozen=True)
class RobotTrial:
    """An exploration to ask for, and the fault that is injected meanwhile."""

    request: ExplorationRequest
    fault: PlannedRobotFault


@dataclass(frozen=True)
class RobotSession:
    """One life of the explorer on one rig.

    Parameters
    ----------
    rig
        Which.
    start_fault
        What is wrong when the explorer starts; `NO_FAULT` if nothing is.
    trials
        What is asked for.
    exit_by
        Signal that ends the explorer, if no fault has.
    force_mode
        Whether the simulated arm controls forces itself; the others ignore it.
    seed
        Of what the rig draws by itself.
    """

    rig: str
    start_fault: str
    trials: Sequence[RobotTrial]
    exit_by: str
    force_mode: bool = True
    seed: int = 0


def sessions(seed: int) -> Iterator[RobotSession]:
    """Yield sessions without end, one rig after the other."""
    rng = np.random.default_rng((seed, 2))
    for rig in cycle(RIGS):
        yield draw_session(rng, rig)


def draw_session(rng: np.random.Generator, rig: str) -> RobotSession:
    """Return a session with faults drawn by their weights; a fault that kills the explorer comes last."""
    faults = ROBOT_FAULTS[rig]
    starts = {name: fault for name, fault in faults.items() if fault.when == AT_START}
    others = {name: fault for name, fault in faults.items() if fault.when != AT_START}
    start = _draw(rng, starts) if starts and rng.random() < START_FAULT_SHARE else NO_FAULT
    names = [_draw(rng, others) for _ in range(EXPLORATIONS_PER_SESSION)]
    if start != NO_FAULT and faults[start].surface:
        names = [start] * EXPLORATIONS_PER_SESSION  # the surface stays as it is
    elif start != NO_FAULT:
        names = [start, *names[1:]]
    killing = [name for name in names if faults[name].kills][:1]
    names = [name for name in names if not faults[name].kills] + killing
    trials = [RobotTrial(_request(rng, rig), _planned(rng, name, faults[name])) for name in names]
    return RobotSession(
        rig, start, trials, str(rng.choice(EXITS)), force_mode=bool(rng.random() < 0.5), seed=int(rng.integers(1000))
    )


def _draw(rng: np.random.Generator, faults: Mapping[str, RobotFault]) -> str:
    weights = np.array([fault.weight for fault in faults.values()])
    return str(rng.choice(list(faults), p=weights / weights.sum()))


def _planned(rng: np.random.Generator, name: str, fault: RobotFault) -> PlannedRobotFault:
    return PlannedRobotFault(name, float(rng.uniform(fault.low, fault.high)), float(rng.uniform(0.0, LATEST_SHARE)))


def _request(rng: np.random.Generator, rig: str) -> ExplorationRequest:
    """Return a slide; of the simulated arm along ±x, so that it meets or leaves a step or an edge squarely."""
    if rig == HAND:
        return ExplorationRequest(
            'in_hand_sliding',
            speed_m_s=0.02,
            force_n=float(rng.uniform(0.8, 1.5)),
            distance_m=0.02,
            duration_s=float(rng.uniform(2.0, 4.0)),
        )
    force_n, distance_m = float(rng.uniform(1.0, 4.0)), float(rng.uniform(0.04, 0.08))
    direction_rad = float(rng.uniform(-math.pi, math.pi)) if rig == UR else float(rng.choice((0.0, math.pi)))
    return ExplorationRequest(
        'linear_slide',
        speed_m_s=float(rng.uniform(0.02, 0.05)),
        force_n=force_n,
        distance_m=distance_m,
        direction_rad=direction_rad,
    )


def planned_slide_s(request: ExplorationRequest) -> float:
    """Return how long the slide of a request takes."""
    return request.duration_s or request.distance_m / request.speed_m_s
